"""Where SYNC's time comes from: the processor's own pace, or the wall clock.

SYNC is the clock of a measurement: drives latch at SYNC, and a sample's time is its SYNC's. In
lock-step the next SYNC follows as soon as all answers to the last one are in, and time is counted
in periods: a simulation runs as fast as it can and gives the same result every time. On a real bus
SYNCs keep absolute deadlines of the wall clock. A deadline that was missed is skipped and counted,
never made up for, since a burst of SYNCs would make the drives latch at wrong instants. After a
long pause (the caller wrote files, say) none is counted.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from drivers.fieldbus import TOO_LATE

if TYPE_CHECKING:
    from collections.abc import Callable

PATIENCE = 1.0
"""How long answers may take in lock-step with a plant in another thread or process [s]."""

HURRIED_PATIENCE = 0.02
"""The same while axes are being stopped [s]."""

PAUSE = 0.25
"""A caller who stays away longer than this made a pause, rather than missing deadlines [s]."""

CERTAIN = 0.05
"""Share of the period to which the instant of a SYNC must be known: a velocity from two samples is
off by no more than a tenth then."""

WINDOW = 0.8
"""Share of the period in which the answers to a SYNC must arrive on the wall clock."""


class SyncClock:
    """The source of SYNC's time.

    Attributes
    ----------
    skipped : int
        SYNCs left out because their deadline had passed.
    passed_over : int
        SYNCs right before the last one that were passed over: they had waited too long.
    synchronous : bool
        Every answer is in the receive queue before `send` returns.
    uncertain : bool
        When the last SYNC went out is known to `CERTAIN` of a period only.
    """

    def __init__(
        self, period: float, clock: Callable[[], float], start: float | None = None
    ) -> None:
        self.skipped = self.passed_over = 0
        self.synchronous = self.uncertain = False
        self._period = period
        self._clock = clock
        self._start = clock() if start is None else start

    def now(self) -> float:
        """Time since the bus was entered [s]."""
        return self._clock() - self._start

    def due(self) -> float:
        """How long until the next SYNC is due [s], 0 if it is now."""
        return 0.0

    def sending(self) -> None:
        """Take note that a SYNC is about to go out."""

    def sent(self) -> float:
        """Take note that a SYNC went out; return its instant [s]."""
        raise NotImplementedError

    def latched(self, instant: float, before: float) -> float:
        """When inputs were latched that come with what is sent at an instant [s].

        By default it was as the frame `before` passed [s].
        """
        del instant
        return before

    def window(self) -> float:
        """How long answers to the last SYNC may still take [s], at least 0."""
        raise NotImplementedError

    def miss(self) -> None:
        """Let a period pass in which the bus took no SYNC."""
        time.sleep(self._period)

    def hurry(self, hurried: bool) -> None:
        """Wait for a bus that does not answer only as long as a stop of all axes can afford."""


class LockStep(SyncClock):
    """Time counted in SYNCs; the next one is due as soon as the last one is answered.

    Parameters
    ----------
    period : float
        Time between two SYNCs [s].
    synchronous : bool
        All answers are in before `send` returns, so an empty queue means that nothing will come.
    clock : callable
        For the patience with a plant in another thread [s].
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
        """Time since the bus was entered [s]."""
        return self._count * self._period

    def sent(self) -> float:
        """Let one period pass; return the SYNC's instant [s]."""
        self._count += 1
        if not self.synchronous:
            self._patience_ends = self._clock() + self._patience
        return self._count * self._period

    def window(self) -> float:
        """How long answers may still take [s]."""
        return 0.0 if self.synchronous else max(0.0, self._patience_ends - self._clock())

    def miss(self) -> None:
        """Let a period pass, in real time too: what keeps SYNC from passing may not go by ours."""
        self._count += 1
        self.skipped += 1
        time.sleep(self._period)

    def hurry(self, hurried: bool) -> None:
        """Wait less long for answers of a plant in another process."""
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
        """How long until the next deadline [s], 0 if it is now; passes over missed deadlines."""
        late = self._late(self._clock())
        return max(0.0, -late)

    def sending(self) -> None:
        """Take note that a SYNC is about to go out."""
        self._sending = self._clock()

    def sent(self) -> float:
        """Move on to the next deadline; return the SYNC's instant, in the middle of `send` [s].

        Who woke too late for this one has missed it, or the next would follow right behind.
        """
        now = self._clock()
        took = now - self._sending if self._sending is not None else 0.0
        self._sending = None
        self.uncertain = took > 2 * CERTAIN * self._period
        # in whole microseconds, as logs of frames have it, or a replay would differ
        instant = round(now - took / 2, 6)
        self._late(instant)
        self._deadline += self._period
        self._window_ends = instant + WINDOW * self._period
        return instant - self._start

    def _late(self, now: float) -> float:
        """How long the deadline is past [s]; those that were missed are passed over."""
        late = now - self._deadline
        if late > TOO_LATE * self._period:
            missed = math.ceil(late / self._period - TOO_LATE)
            self.skipped += missed if late < PAUSE else 0
            self._deadline += missed * self._period
            late -= missed * self._period
        return late

    def window(self) -> float:
        """How long answers may still take [s]."""
        return max(0.0, self._window_ends - self._clock())

    def miss(self) -> None:
        """Wait for the deadline, and leave it behind."""
        time.sleep(self.due())
        self._deadline += self._period
