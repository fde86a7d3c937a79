"""Clock of EtherCAT: the wall clock, or the reference of the distributed clocks.

Each frame with process data returns the time of its passage at the reference. A second-order filter
estimates that time and its rate, so that a frame sent late has little influence. Deadlines are then
in the time of the reference: frames pass half a period before SYNC0, at which drives apply outputs
and latch inputs. Both sides may be late by as much.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from drivers.sync_clock import WallClock

if TYPE_CHECKING:
    from collections.abc import Callable

SHIFT = 0.5
"""Delay of SYNC0 after the due instant of a frame, as a share of the period."""
AHEAD = 0.1
"""Minimum time from set-up of a drive to its first SYNC0 [s]; as in SOEM."""
_TIME = 0.5
"""Time constant of the filter [s]: some hundred frames, so that it rejects the jitter of a computer
and follows the drift of a warming crystal."""
_STRAY, _STRAYS = 0.25, 10
"""Deviation as a share of the period, and number of consecutive frames with such deviations of one
sign after which the reference has jumped, as in a plant whose process was stopped."""
_MOST = 50e-6
"""Largest correction of the filter by a frame [s]; a larger deviation is a delay of the computer.
Within `_TIME` the filter follows clocks that differ by 200 ppm or more, twice as much as
crystals."""


class ReferenceClock(WallClock):
    """Wall clock until `begin`; afterwards the clock of the reference.

    Parameters
    ----------
    period : float
        Time between two frames with process data [s].
    host : callable
        Monotonic clock of this computer [s].

    Attributes
    ----------
    host : callable
        Clock of this computer.
    follows : bool
        True after `begin`.
    skew : float
        Rate of the reference relative to this computer, less 1.
    """

    def __init__(self, period: float, *, host: Callable[[], float] = time.perf_counter) -> None:
        self.host = host
        self.follows, self.skew = False, 0.0
        self._at = self._shown = host()
        self._zero = 0
        self._strays: list[float] = []
        super().__init__(period, clock=lambda: self._convert_host(self.host()))

    def begin(self, reference: int, host: float) -> None:
        """Follow the reference, which showed a time [ns] when this computer's clock was `host`."""
        self._zero, self.follows = reference - round(1e9 * self._convert_host(host)), True
        # deadlines are whole periods after the bus was entered, in time of the reference
        self._deadline = self._start + self._period * math.ceil(self.now() / self._period)

    @property
    def shift(self) -> float:
        """Delay of SYNC0 after the due instant of a frame [s]."""
        return SHIFT * self._period

    def first_sync0(self, reference: int) -> tuple[int, int]:
        """Return a SYNC0 at least `AHEAD` after the reference's time, and the cycle [ns]."""
        shown = 1e-9 * (reference - self._zero) - self._start + AHEAD
        cycle = round(1e9 * self._period)
        grid = self._zero + round(1e9 * (self._start + self.shift))
        return grid + cycle * math.ceil(shown / self._period), cycle

    def note_sent(self) -> float:
        """Return the instant of a frame (see `WallClock`); SYNC0 gives the time of inputs."""
        instant = super().note_sent()
        self.uncertain &= not self.follows
        return instant

    def latch_instant(self, instant: float, before: float) -> float:
        """Return the last SYNC0 before an instant, or without clocks the frame before."""
        if not self.follows:
            return before
        return self._period * (math.floor(instant / self._period - SHIFT) + SHIFT)

    def follow(self, reference: int, instant: float) -> float:
        """Evaluate the passage of a frame, sent at `instant`, at the reference [ns]; return it [s].

        Both instants count from entering the bus, as `now` does.
        """
        passed = 1e-9 * (reference - self._zero) - self._start
        off = passed - instant
        if abs(off) > _STRAY * self._period:
            passed += self._evaluate_stray(off)
        else:
            self._strays.clear()
        off = min(max(off, -_MOST), _MOST)
        host, gain = self.host(), self._period / _TIME
        self._shown, self._at = self._convert_host(host) + 2 * gain * off, host
        self.skew += gain * off / _TIME
        return passed

    def _evaluate_stray(self, off: float) -> float:
        """Record a frame with a large deviation [s]; return the change of the estimated time."""
        if self._strays and (off > 0) != (self._strays[-1] > 0):
            self._strays.clear()
        self._strays.append(off)
        if len(self._strays) < _STRAYS:
            return 0.0
        periods = round(min(self._strays, key=abs) / self._period)
        jump = min(self._strays, key=abs) - periods * self._period
        self._shown += jump  # deadlines keep their distance from SYNC0
        self._zero += round(1e9 * periods * self._period)
        self._strays.clear()
        return -periods * self._period

    def _convert_host(self, host: float) -> float:
        """Convert a time of this computer's clock to the estimated time of the reference [s]."""
        return self._shown + (host - self._at) * (1 + self.skew)
