"""Exchange of frames with the slaves on a line.

A lost frame (nothing returns in time) is repeated where that is harmless: writing registers twice
has the same effect. After a line has failed, a frame is sent once only until one returns, so that
the end of a session does not wait for a dead line. Process data are not repeated, since they would
be obsolete. Every frame has a number in its first datagram and our source address, so that a late
frame is not mistaken for its successor, nor a frame of another master for ours.

A frame consists of datagrams (ETG.1000.4). Slaves process a frame during its passage and return it
in the same form, so a frame of another form is no answer. The working counter of each datagram
shows how many slaves took part.
"""

from __future__ import annotations

import enum
import os
import struct
import time
from typing import TYPE_CHECKING, NamedTuple

from drivers.drive_bus import BusUnavailable
from drivers.ethercat.wire import ETHERTYPE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.ethercat.wire import Wire

SHORTEST, LONGEST = 60, 1514
"""Length of an Ethernet frame without check sum [bytes]."""
START = 16
"""Offset of the first datagram, after the Ethernet and EtherCAT headers."""
HEAD, TAIL = 10, 2
"""Header and working counter of a datagram [bytes]."""
INDEX, SOURCE = 17, slice(7, 12)
"""Offset of the first datagram's index, and the part of the source address unchanged by slaves."""
MORE, SIZE = 0x8000, 0x07FF
_DATAGRAMS = 0x1000
"""Type in the frame header: datagrams follow."""
_HEADER = struct.Struct("<BBIHH")
_COUNTER = struct.Struct("<H")


class Command(enum.IntEnum):
    """Command of a datagram: by position, by address, broadcast, or logical memory."""

    APRD, APWR = 1, 2
    FPRD, FPWR = 4, 5
    BRD, BWR = 7, 8
    LRD, LRW = 10, 12
    FRMW = 14


class Datagram(NamedTuple):
    """Datagram; `address` is slave and register, or logical."""

    command: Command
    address: int
    data: bytes


class Answer(NamedTuple):
    """Answer to a datagram, with the number of slaves that took part."""

    data: bytes
    counter: int


def address_of(slave: int, place: int) -> int:
    """Return the address of a register of a slave (station address, or negative position)."""
    return slave & 0xFFFF | place << 16


def frame_of(source: bytes, datagrams: Sequence[Datagram]) -> bytearray:
    """Make a frame of datagrams.

    Parameters
    ----------
    source : bytes
        Address of the sender, six bytes.
    datagrams : sequence of Datagram
        Datagrams, at least one.

    Raises
    ------
    ValueError
        The datagrams do not fit into one frame.
    """
    body = bytearray()
    for number, (command, address, data) in enumerate(datagrams, start=1):
        more = MORE if number < len(datagrams) else 0
        body += _HEADER.pack(command, 0, address, len(data) | more, 0) + data + bytes(TAIL)
    head = b"\xff" * 6 + source + ETHERTYPE.to_bytes(2, "big")
    frame = bytearray(head) + struct.pack("<H", len(body) | _DATAGRAMS) + body
    if len(frame) > LONGEST:
        raise ValueError(f"{len(frame)} bytes are too long for a frame of {LONGEST}")
    return frame.ljust(SHORTEST, b"\0")


def answers_of(frame: bytes, datagrams: Sequence[Datagram]) -> tuple[Answer, ...] | None:
    """Return the answers in a returned frame; None if it has another form."""
    answers, place = [], START
    for command, _, sent in datagrams:
        end = place + HEAD + len(sent)
        if end + TAIL > len(frame):
            return None
        found, _, _, length, _ = _HEADER.unpack_from(frame, place)
        if found != command or length & SIZE != len(sent):
            return None
        answers.append(Answer(frame[place + HEAD : end], _COUNTER.unpack_from(frame, end)[0]))
        place = end + TAIL
    return tuple(answers)


ATTEMPTS = 10
"""Largest number of attempts for a frame: with one in five lost, one in ten million fails."""
PATIENCE = 0.05
"""Longest return time of a frame without process data [s], above the delays of this computer."""
LOCK_STEP_PATIENCE = 0.5
"""Longest return time if a plant in another process answers, on a busy machine [s]."""
PAUSE = 0.0005
"""Time between two polls of a slave's firmware [s]."""


class Line:
    """Exchange of frames with slaves.

    Parameters
    ----------
    wire : Wire
        Open interface.
    patience : float
        Longest return time of a frame without process data [s].

    Attributes
    ----------
    idle : callable
        Called during waits for a slave's firmware.
    lost : int
        Frames that did not return in time.
    foreign : int
        Frames of another master.
    """

    def __init__(self, wire: Wire, patience: float = PATIENCE) -> None:
        self.wire, self.patience = wire, patience
        self.idle: Callable[[], None] = lambda: None
        self.lost = self.foreign = 0
        self._dead = False
        self._number = 0
        self._source = b"\x02" + os.urandom(5)

    def frame(self, datagrams: Sequence[Datagram]) -> bytearray:
        """Make a frame for repeated use by `send` (see `frame_of`)."""
        return frame_of(self._source, datagrams)

    def send(self, frame: bytearray) -> None:
        """Send a frame with a new number.

        Raises
        ------
        BusUnavailable
            The interface no longer sends.
        """
        self._number = (self._number + 1) & 0xFF
        frame[INDEX] = self._number
        self.wire.send(frame)

    def receive(self, timeout: float) -> bytes | None:
        """Return the frame sent last after its return, None if lost within `timeout` [s].

        Raises
        ------
        BusUnavailable
            The interface no longer receives.
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
        """Send datagrams in a frame, once; return the answers, None if lost."""
        self.send(self.frame(datagrams))
        frame = self.receive(self.patience)
        return None if frame is None else answers_of(frame, datagrams)

    def ask(self, *datagrams: Datagram) -> tuple[Answer, ...]:
        """Exchange datagrams as `exchange` does, repeatedly if the frame is lost.

        Raises
        ------
        BusUnavailable
            No frame returns.
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
        raise BusUnavailable(f"no frame returned within {self.patience:g} s{other}")

    def read_all(self, place: int, size: int) -> Answer:
        """Read a register of all slaves at once: combined bits, and the number of slaves."""
        return self.ask(Datagram(Command.BRD, place << 16, bytes(size)))[0]

    def pause(self) -> None:
        """Let a slave's firmware work for a moment."""
        self.idle()
        time.sleep(PAUSE)
