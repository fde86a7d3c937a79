"""Frames to all slaves on one line and back, each matched with what came back of it.

A frame that is lost (nothing comes back in time) is sent again where that does no harm: registers
are written to the same effect twice. A line that none came back of is asked once until one does, so
that an end does not wait for a dead one. Process data are not repeated, for their time is over.
Every frame carries a number in its first datagram and an address of ours, so that one that comes
late is not taken for its successor, and another master's is not taken for ours.
"""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING

from drivers.drive_bus import BusUnavailable
from drivers.ethercat.frames import INDEX, SOURCE, Answer, Command, Datagram, answers_of, frame_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.ethercat.wire import Wire

ATTEMPTS = 10
"""How often a frame is sent that does not come back: with one in five lost, one in ten million
is lost for good."""
PATIENCE = 0.05
"""How long a frame may take that is no process data [s]: longer than this computer is late."""
LOCK_STEP_PATIENCE = 0.5
"""The same where a plant in another process answers, which may be as busy as its machine [s]."""
PAUSE = 0.0005
"""Between two questions that wait for a slave's firmware [s]."""


class Line:
    """Exchanges frames with slaves.

    Parameters
    ----------
    wire : Wire
        Open.
    patience : float
        How long a frame may take that is no process data [s].

    Attributes
    ----------
    idle : callable
        Called while a slave's firmware is waited for.
    lost : int
        Frames that did not come back in time.
    foreign : int
        Frames of another master.
    """

    def __init__(self, wire: Wire, patience: float = PATIENCE) -> None:
        self.wire = wire
        self.patience = patience
        self.idle: Callable[[], None] = lambda: None
        self.lost = self.foreign = 0
        self._dead = False
        self._number = 0
        self._source = b"\x02" + os.urandom(5)

    def frame(self, datagrams: Sequence[Datagram]) -> bytearray:
        """Make a frame to be sent by `send` again and again (see `frame_of`)."""
        return frame_of(self._source, datagrams)

    def send(self, frame: bytearray) -> None:
        """Send a frame under a new number.

        Raises
        ------
        BusUnavailable
            None can be sent any more.
        """
        self._number = (self._number + 1) & 0xFF
        frame[INDEX] = self._number
        self.wire.send(frame)

    def receive(self, timeout: float) -> bytes | None:
        """Return what came back of the frame that was sent last, None if nothing does in time [s].

        Raises
        ------
        BusUnavailable
            Nothing can come any more.
        """
        wire, ends = self.wire, 0.0
        while (frame := wire.receive(timeout)) is not None:
            if len(frame) > INDEX and frame[SOURCE] == self._source[1:]:
                if frame[INDEX] == self._number:
                    self._dead = False
                    return frame
            else:
                self.foreign += 1
            ends = ends or time.perf_counter() + timeout
            timeout = max(0.0, ends - time.perf_counter())
        self.lost += 1
        return None

    def exchange(self, *datagrams: Datagram) -> tuple[Answer, ...] | None:
        """Send datagrams in one frame, once; return what came back, None if it was lost."""
        self.send(self.frame(datagrams))
        frame = self.receive(self.patience)
        return None if frame is None else answers_of(frame, datagrams)

    def ask(self, *datagrams: Datagram) -> tuple[Answer, ...]:
        """Do as `exchange`, again where the frame is lost.

        Raises
        ------
        BusUnavailable
            None comes back.
        """
        for _ in range(1 if self._dead else ATTEMPTS):
            answers = self.exchange(*datagrams)
            if answers is not None:
                return answers
        self._dead = True
        other = (
            "; another master sends on this interface, end it first"
            if self.foreign
            else "; check the cable to the first drive and its supply"
        )
        raise BusUnavailable(f"no frame comes back within {self.patience:g} s{other}")

    def read_all(self, place: int, size: int) -> Answer:
        """Read a register of all slaves at once: each bit that any has, and how many there are."""
        return self.ask(Datagram(Command.BRD, place << 16, bytes(size)))[0]

    def pause(self) -> None:
        """Let a slave's firmware work."""
        self.idle()
        time.sleep(PAUSE)
