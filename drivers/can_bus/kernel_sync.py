"""SYNC sent by the kernel: the broadcast manager of Linux, independent of this process's load.

The broadcast manager keeps absolute deadlines with a kernel timer and skips missed ones.
`KernelSync` starts it on a socketcan bus and lets the driver work as if it sent SYNC itself:
"sending" a SYNC waits for the next one of the kernel, which is returned like a frame of another
socket, with its instant. Nothing is lost during an SDO transfer, say: every SYNC and its TPDOs wait
in order of arrival. After a long pause they are dropped as obsolete. If this process dies, SYNC
ends as well.
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
"""Longest silence of the kernel's SYNC, beyond three periods, until the bus is down [s]."""

BABBLE = 20_000
"""Largest number of frames skipped in one call: a faulty node may send without end."""

STALE = 2
"""Age [periods] at which a waiting SYNC is skipped in favour of the newest."""

AT_ONCE = 50e-6
"""Longest time between two clock readings without an interruption [s]."""


class KernelSync(can.BusABC):
    """A bus with SYNC from the kernel; `send` of a SYNC waits for the kernel's next one.

    Parameters
    ----------
    inner : can.BusABC
        A bus with `Capabilities.kernel_sync`; stays open when this one is shut down.
    period : float
        Time between two SYNCs [s].
    answers : collection of int
        Identifiers of the TPDOs that answer a SYNC.
    pause : float
        Absence of the caller after which waiting frames are obsolete [s].
    clock, wall : callable
        Monotonic clock; clock of the frames' time stamps [s].

    Attributes
    ----------
    deliver : callable
        Receives frames that arrive during the wait for a SYNC.
    instant : float
        Instant of the last SYNC, by `clock` [s].
    skipped : int
        SYNCs left out by the kernel, lost, or passed over.
    passed_over : int
        SYNCs passed over immediately before the last one, since they had waited too long.
    silence : float or None
        Longest silence of SYNC [s]; None for three periods and `SILENCE`.
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
        self.deliver: Callable[[can.Message], None] = lambda _frame: None
        self.instant = clock()
        self.skipped = self.passed_over = 0
        self.silence: float | None = None
        self.channel_info = inner.channel_info
        self._inner, self._period, self._pause = inner, period, pause
        self._answers = frozenset(answers)
        self._clock, self._wall = clock, wall
        self._offset = clock() - wall()
        self._task: can.CyclicSendTaskABC | None = None
        self._waiting: deque[can.Message] = deque()
        self._returned = clock()
        self._counting = False
        super().__init__(inner.channel_info)

    @property
    def capabilities(self) -> Capabilities:
        """No capability of the inner bus, since frames wait here until their SYNC is taken."""
        return Capabilities()

    @property
    def overdue(self) -> bool:
        """True if the next SYNC has arrived, so that waiting for more answers is pointless."""
        return bool(self._waiting) and self._waiting[0].arbitration_id == SYNC_ID

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; in place of a SYNC, wait for the kernel's next one.

        Raises
        ------
        drivers.drive_bus.BusUnavailable
            No SYNC of the kernel arrives.
        """
        if msg.arbitration_id != SYNC_ID or msg.is_extended_id:
            return self._inner.send(msg, timeout)
        if self._task is None:
            sync = can.Message(arbitration_id=SYNC_ID, is_extended_id=False)
            self._task = self._inner.send_periodic(sync, self._period)
            self._drop_waiting()
        elif self._clock() - self._returned > self._pause:
            self._drop_waiting()
        self._take(self._await_sync())
        self.passed_over = 0
        if self._stale:
            self._catch_up()
            if self._stale:  # the kernel's queue was full and later frames are lost
                self._pass_over()
                self._take(self._await_sync())
        self._returned = self._clock()
        return None

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Receive a frame except SYNC; a TPDO only after `send` has taken the preceding SYNC."""
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
        """Skip SYNCs that have waited too long: supervision needs the newest."""
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
        """Count the SYNC taken last as passed over."""
        self.passed_over += 1
        self.skipped += 1

    def _await_sync(self) -> can.Message:
        patience = 3 * self._period + SILENCE if self.silence is None else self.silence
        ends = self._clock() + patience
        while not self.overdue:
            left = ends - self._clock()
            if left <= 0:
                raise BusUnavailable(
                    f"{self.channel_info}: no SYNC received from the kernel for {patience:.2g} "
                    "s; check cable and termination, and that the interface is up (ip -details "
                    "link)"
                )
            frame = self.recv(left)
            if frame is not None:
                self.deliver(frame)
        return self._waiting.popleft()

    def _take(self, sync: can.Message) -> None:
        before, last = self._clock(), self.instant
        wall = self._wall()
        # an impossible age: the wall clock was set after the stamp, so the old offset applies
        possible = -AT_ONCE < wall - sync.timestamp < STALE * self._period
        if possible and self._clock() - before < AT_ONCE:
            self._offset = before - wall
        self.instant = sync.timestamp + self._offset
        if self._counting:
            self.skipped += max(0, round((self.instant - last) / self._period) - 1)
        self._counting = True

    def _drop_waiting(self) -> None:
        """Drop obsolete SYNCs and TPDOs."""
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
        """Return True for a SYNC of this machine, False for that of another master."""
        return frame.arbitration_id == SYNC_ID and not (frame.is_rx or frame.is_extended_id)
