"""SYNC from the kernel: Linux's broadcast manager sends it, however busy this process is.

The broadcast manager keeps absolute deadlines by a timer in the kernel and leaves out what it
missed. `KernelSync` starts it on a socketcan bus and lets the driver work as if it sent SYNC by
itself: "sending" one means to wait for the kernel's next, which the kernel hands back like any
frame of another socket, with the instant at which it went out. Whoever is busy meanwhile, with an
SDO say, loses nothing: every SYNC and the TPDOs behind it wait in the order of their arrival. After
a long pause they are dropped, since nobody wants the past then. If this process dies, so does SYNC.
"""

from __future__ import annotations

import time
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING

import can

from drivers.can_bus.capabilities import Capabilities
from drivers.drive_bus import BusUnavailable

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

SYNC_ID = 0x80

SILENCE = 0.5
"""How long the kernel's SYNC may stay away, beyond three periods, before the bus is down [s]."""

BABBLE = 20_000
"""Frames that are passed over at once: a bus may never fall silent."""

STALE = 2
"""Periods after which a SYNC that waits for us is passed over for the newest."""

AT_ONCE = 50e-6
"""Two readings of clocks that lie closer together were not interrupted [s]."""


class KernelSync(can.BusABC):
    """A bus on which the kernel sends SYNC and `send` of a SYNC waits for it.

    Parameters
    ----------
    inner : can.BusABC
        A bus with `Capabilities.kernel_sync`; stays open when this one is shut down.
    period : float
        Time between two SYNCs [s].
    answers : collection of int
        Identifiers of the TPDOs that answer a SYNC.
    pause : float
        A caller who stays away longer wants nothing of the past [s].
    clock, wall : callable
        Monotonic time; time of the frames' time stamps [s].

    Attributes
    ----------
    deliver : callable
        Takes frames that arrive while a SYNC is waited for.
    instant : float
        When the last SYNC went out, by `clock` [s].
    skipped : int
        SYNCs that the kernel left out, that were lost on their way to us, or passed over.
    passed_over : int
        SYNCs right before the last one that had waited for us for too long.
    silence : float or None
        How long a SYNC may stay away [s]; None for three periods and `SILENCE`.
    """

    def __init__(
        self,
        inner: can.BusABC,
        period: float,
        answers: Collection[int],
        *,
        pause: float,
        clock: Callable[[], float] = time.perf_counter,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.deliver: Callable[[can.Message], None] = _ignore
        self.instant = clock()
        self.skipped = self.passed_over = 0
        self.silence: float | None = None
        self.channel_info = inner.channel_info
        self._inner = inner
        self._period = period
        self._pause = pause
        self._answers = frozenset(answers)
        self._clock = clock
        self._wall = wall
        self._offset = clock() - wall()
        self._task: can.CyclicSendTaskABC | None = None
        self._waiting: deque[can.Message] = deque()
        self._returned = clock()
        self._counting = False
        super().__init__(inner.channel_info)

    @property
    def capabilities(self) -> Capabilities:
        """None of the inner bus's: frames wait here for their SYNC."""
        return Capabilities()

    @property
    def overdue(self) -> bool:
        """The next SYNC is here already: nobody need wait for answers to the last one."""
        return bool(self._waiting) and self._waiting[0].arbitration_id == SYNC_ID

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; a SYNC is waited for instead.

        Raises
        ------
        drivers.drive_bus.BusUnavailable
            The kernel's SYNC stays away.
        """
        if msg.arbitration_id != SYNC_ID or msg.is_extended_id:
            return self._inner.send(msg, timeout)
        if self._task is None:
            sync = can.Message(arbitration_id=SYNC_ID, is_extended_id=False)
            self._task = self._inner.send_periodic(sync, self._period)
            self._forget()
        elif self._clock() - self._returned > self._pause:
            self._forget()
        self._take(self._await_sync())
        self.passed_over = 0
        if self._stale:
            self._catch_up()
            if self._stale:  # the kernel's queue was full, and what came since is lost
                self._pass_over()
                self._take(self._await_sync())
        self._returned = self._clock()
        return None

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Receive a frame that is no SYNC; a TPDO only once its SYNC has been waited for."""
        if self._waiting and not self.overdue:
            return self._waiting.popleft()
        while (frame := self._inner.recv(timeout)) is not None:
            if self._is_ours(frame):
                self._waiting.append(frame)
                timeout = 0.0
            elif self._waiting and frame.arbitration_id in self._answers:
                self._waiting.append(frame)
            else:
                return frame
        return None

    def shutdown(self) -> None:
        """Stop the kernel's SYNC; the inner bus stays open."""
        super().shutdown()
        if self._task is not None:
            with suppress(OSError, can.CanError):
                self._task.stop()

    @property
    def _stale(self) -> bool:
        return self._clock() - self.instant > STALE * self._period

    def _catch_up(self) -> None:
        """Pass over what has waited too long: who supervises axes looks at the newest SYNC."""
        arrived, self._waiting = list(self._waiting), deque()
        while len(arrived) < BABBLE and (frame := self._inner.recv(0.0)) is not None:
            arrived.append(frame)
        newest = max((n for n, frame in enumerate(arrived) if self._is_ours(frame)), default=-1)
        for number, frame in enumerate(arrived):
            if self._is_ours(frame):
                self.passed_over += number < newest
                if number == newest:
                    self._pass_over()
                    self._take(frame)
            elif number > newest or frame.arbitration_id not in self._answers:
                self._waiting.append(frame)

    def _pass_over(self) -> None:
        """Count the SYNC that was taken already."""
        self.passed_over += 1
        self.skipped += 1

    def _await_sync(self) -> can.Message:
        patience = 3 * self._period + SILENCE if self.silence is None else self.silence
        ends = self._clock() + patience
        while not self.overdue:
            left = ends - self._clock()
            if left <= 0:
                raise BusUnavailable(
                    f"{self.channel_info}: no SYNC came back from the kernel for"
                    f" {patience:.2g} s; check cable and termination, and that"
                    " the interface is up (ip -details link)"
                )
            frame = self.recv(left)
            if frame is not None:
                self.deliver(frame)
        return self._waiting.popleft()

    def _take(self, sync: can.Message) -> None:
        before, last = self._clock(), self.instant
        wall = self._wall()
        if self._clock() - before < AT_ONCE:
            self._offset = before - wall
        self.instant = sync.timestamp + self._offset
        if self._counting:
            self.skipped += max(0, round((self.instant - last) / self._period) - 1)
        self._counting = True

    def _forget(self) -> None:
        """Drop the past: the SYNCs and TPDOs that nobody waited for."""
        self._waiting.clear()
        for _ in range(BABBLE):
            frame = self._inner.recv(0.0)
            if frame is None:
                break
            if not (self._is_ours(frame) or frame.arbitration_id in self._answers):
                self.deliver(frame)
        self._counting = False

    @staticmethod
    def _is_ours(frame: can.Message) -> bool:
        """Whether this is a SYNC of this machine and not of another master."""
        return frame.arbitration_id == SYNC_ID and not (frame.is_rx or frame.is_extended_id)


def _ignore(_frame: can.Message) -> None:
    pass
