"""Sources of SYNC's time: the pace of the processor, or the wall clock.

SYNC is the clock of a measurement: drives latch at SYNC, and the time of a sample is that of its
SYNC. In lock-step the next SYNC follows as soon as the last one is answered, and time is counted
in periods: a simulation runs as fast as it can and gives the same result every time. On a real bus
SYNCs keep absolute deadlines of the wall clock. A missed deadline is skipped and counted, never
made up for, since a burst of SYNCs would make the drives latch at wrong instants. After a long
pause (the caller wrote files, say) none is counted.
"""

from __future__ import annotations

import math
import os
import time
from typing import TYPE_CHECKING, TypeVar

from drivers.fieldbus import TOO_LATE

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")

PATIENCE = 1.0
"""Longest wait for a plant in another thread or process in lock-step [s]."""

HURRIED_PATIENCE = 0.02
"""Longest wait for a plant in lock-step during a stop of the axes [s]."""

PAUSE = 0.25
"""Minimum pause of a caller [s]; a shorter absence counts as missed deadlines."""

CERTAIN = 0.05
"""Largest error of a SYNC's instant as a share of the period: the error of a velocity from
two samples stays below a tenth."""

WINDOW = 0.8
"""Share of the period in which the answers to a SYNC must arrive on the wall clock."""

LOCK_STEP_WAIT = 0.1
"""Shortest wait for a plant in lock-step [s]; waits on the wall clock are shorter."""

POLLING_TIME = 0.0003
"""Duration of active polling [s]: several cycles of a peer in lock-step; .3 % of a core if repeated
once per `LOCK_STEP_WAIT`."""


def poll_actively(receive: Callable[[], T | None]) -> T | None:
    """Poll `receive` for `POLLING_TIME` without sleeping; return None if nothing came.

    A peer in lock-step answers sooner than the kernel wakes a process: a cycle with the plant in
    another process takes .03 ms over EtherCAT and .07 ms over a local channel if both sides poll,
    .13 to .15 ms if both sleep (`benchmarks/two_processes.py`, two cores).
    """
    ends = time.perf_counter() + POLLING_TIME
    while time.perf_counter() < ends:
        if (found := receive()) is not None:
            return found
        os.sched_yield()  # the sender may need this core
    return None


class SyncClock:
    """The source of SYNC's time.

    Attributes
    ----------
    skipped : int
        SYNCs left out because their deadline had passed.
    passed_over : int
        SYNCs passed over immediately before the last one: their answers were too old.
    synchronous : bool
        True if every answer is in the receive queue before `send` returns.
    uncertain : bool
        True if the error of the last SYNC's instant may exceed `CERTAIN` of a period.
    """

    def __init__(
        self, period: float, clock: Callable[[], float], start: float | None = None
    ) -> None:
        self.skipped = self.passed_over = 0
        self.synchronous = self.uncertain = False
        self._period, self._clock = period, clock
        self._start = clock() if start is None else start

    def now(self) -> float:
        """Return the time since the bus was entered [s]."""
        return self._clock() - self._start

    def due(self) -> float:
        """Return the time until the next SYNC is due [s], 0 if due now."""
        return 0.0

    def note_sending(self) -> None:
        """Note that a SYNC is about to be sent."""

    def note_sent(self) -> float:
        """Note that a SYNC was sent; return its instant [s]."""
        raise NotImplementedError

    def latch_instant(self, instant: float, before: float) -> float:
        """Return the instant [s] at which the inputs in the frame of `instant` were latched.

        By default this is `before`, the instant of the previous frame [s].
        """
        del instant
        return before

    def window(self) -> float:
        """Return the time left for answers to the last SYNC [s], at least 0."""
        raise NotImplementedError

    def miss(self) -> None:
        """Let a period pass in which the bus accepted no SYNC."""
        time.sleep(self._period)

    def hurry(self, hurried: bool) -> None:
        """Shorten waits for the bus to the time available during a stop of the axes."""


class LockStep(SyncClock):
    """Time counted in SYNCs; a SYNC is due as soon as the previous SYNC is answered.

    Parameters
    ----------
    period : float
        Time between two SYNCs [s].
    synchronous : bool
        True if answers are queued before `send` returns, so that an empty queue ends every wait.
    clock : callable
        Clock for the patience with a plant in another thread [s].
    """

    def __init__(
        self, period: float, *, synchronous: bool, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        super().__init__(period, clock, start=0.0)
        self.synchronous = synchronous
        self._count = 0
        self._patience = PATIENCE
        self._patience_ends = -math.inf

    def now(self) -> float:
        """Return the time since the bus was entered [s]."""
        return self._count * self._period

    def note_sent(self) -> float:
        """Let a period pass; return the SYNC's instant [s]."""
        self._count += 1
        if not self.synchronous:
            self._patience_ends = self._clock() + self._patience
        return self._count * self._period

    def window(self) -> float:
        """Return the time left for answers [s]."""
        return 0.0 if self.synchronous else max(0.0, self._patience_ends - self._clock())

    def miss(self) -> None:
        """Let a period pass, in real time too: the obstacle on the bus may last in real time."""
        self._count += 1
        self.skipped += 1
        time.sleep(self._period)

    def hurry(self, hurried: bool) -> None:
        """Shorten the wait for a plant in another process during a stop of the axes."""
        self._patience = HURRIED_PATIENCE if hurried else PATIENCE


class WallClock(SyncClock):
    """Absolute deadlines on a monotonic clock; missed ones are skipped and counted.

    Parameters
    ----------
    period : float
        Time between two SYNCs [s].
    clock : callable
        Monotonic time [s].
    """

    def __init__(self, period: float, *, clock: Callable[[], float] = time.perf_counter) -> None:
        super().__init__(period, clock)
        self._deadline = self._start
        self._window_ends = self._start
        self._sending: float | None = None

    def due(self) -> float:
        """Return the time until the next deadline [s], 0 if due now; skip missed deadlines."""
        late = self._late(self._clock())
        return max(0.0, -late)

    def note_sending(self) -> None:
        """Note that a SYNC is about to be sent."""
        self._sending = self._clock()

    def note_sent(self) -> float:
        """Advance to the next deadline; return the SYNC's instant, the middle of `send` [s].

        A SYNC sent too late for its deadline counts for the next deadline; otherwise two SYNCs
        would follow each other at once.
        """
        now = self._clock()
        took = now - self._sending if self._sending is not None else 0.0
        self._sending = None
        self.uncertain = took > 2 * CERTAIN * self._period
        # in whole microseconds, as in logs of frames; otherwise a replay would differ
        instant = round(now - took / 2, 6)
        self._late(instant)
        self._deadline += self._period
        self._window_ends = instant + WINDOW * self._period
        return instant - self._start

    def _late(self, now: float) -> float:
        """Return the delay after the deadline [s], once missed deadlines are skipped."""
        late = now - self._deadline
        if late > TOO_LATE * self._period:
            missed = math.ceil(late / self._period - TOO_LATE)
            self.skipped += missed if late < PAUSE else 0
            self._deadline += missed * self._period
            late -= missed * self._period
        return late

    def window(self) -> float:
        """Return the time left for answers [s]."""
        return max(0.0, self._window_ends - self._clock())

    def miss(self) -> None:
        """Wait for the deadline and advance to the next one."""
        time.sleep(self.due())
        self._deadline += self._period
