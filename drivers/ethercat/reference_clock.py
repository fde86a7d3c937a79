"""The wall clock, and where the line has one the clock of its reference, which it then follows.

Each frame with process data comes back with the time at which it passed the reference. A filter of
second order draws our idea of that time, and of how fast it goes, towards what came back, so a
frame that this computer sends late moves neither. Deadlines are those of the reference then: frames
pass half a period before SYNC0, at which drives let outputs act and latch inputs. Both sides
may be late by as much.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from drivers.sync_clock import WallClock

if TYPE_CHECKING:
    from collections.abc import Callable

SHIFT = 0.5
"""SYNC0 after the instant at which a frame is due, as a share of the period."""
AHEAD = 0.1
"""How long before its first SYNC0 a drive is set to it, at least [s]; SOEM takes as long."""
_TIME = 0.5
"""Time constant of the filter [s]: some hundred frames, so that it takes the jitter of a computer
for none, and a crystal that warms up for what it is."""
_STRAY, _STRAYS = 0.25, 10
"""Share of the period by which so many frames in a row must be off, to the same side, before the
reference is taken to have jumped, as a plant does whose process was stopped."""
_MOST = 50e-6
"""What one frame moves the filter by at most [s]: more is this computer's delay, not a clock's.
In `_TIME` that follows clocks which differ by 200 ppm or more, twice what two crystals may."""


class ReferenceClock(WallClock):
    """The wall clock, until `begin`; from then on the clock of the reference.

    Parameters
    ----------
    period : float
        Time between two frames with process data [s].
    host : callable
        Monotonic time of this computer [s].

    Attributes
    ----------
    host : callable
        As given.
    follows : bool
        It is the reference's.
    skew : float
        By how much the reference is faster than this computer, as a share.
    """

    def __init__(self, period: float, *, host: Callable[[], float] = time.perf_counter) -> None:
        self.host = host
        self.follows, self.skew = False, 0.0
        self._at = self._shown = host()
        self._zero = 0
        self._strays: list[float] = []
        super().__init__(period, clock=self._now)

    def begin(self, reference: int, host: float) -> None:
        """Follow the reference, which showed a time [ns] when this computer's clock was `host`."""
        self._zero, self.follows = reference - round(1e9 * self._at_host(host)), True
        # The grid of deadlines is that of whole periods since the bus was entered, in its time.
        self._deadline = self._start + self._period * math.ceil(self.now() / self._period)

    @property
    def shift(self) -> float:
        """SYNC0 after the instant at which a frame is due [s]."""
        return SHIFT * self._period

    def first_sync0(self, reference: int) -> tuple[int, int]:
        """Return a SYNC0 far enough ahead of the reference's time, and the cycle [ns]."""
        shown = 1e-9 * (reference - self._zero) - self._start + AHEAD
        cycle = round(1e9 * self._period)
        grid = self._zero + round(1e9 * (self._start + self.shift))
        return grid + cycle * math.ceil(shown / self._period), cycle

    def note_sent(self) -> float:
        """Return the instant of a frame (see `WallClock`); inputs are timed by SYNC0 instead."""
        instant = super().note_sent()
        self.uncertain &= not self.follows
        return instant

    def latch_instant(self, instant: float, before: float) -> float:
        """Return the last SYNC0 before an instant, without clocks when a frame passed before."""
        if not self.follows:
            return before
        return self._period * (math.floor(instant / self._period - SHIFT) + SHIFT)

    def follow(self, reference: int, instant: float) -> float:
        """Take when the frame that was sent at `instant` passed the reference [ns]; return it [s].

        Both instants count from when the bus was entered, as `now` does.
        """
        passed = 1e-9 * (reference - self._zero) - self._start
        off = passed - instant
        if abs(off) > _STRAY * self._period:
            passed += self._strayed(off)
        else:
            self._strays.clear()
        off = min(max(off, -_MOST), _MOST)
        host, gain = self.host(), self._period / _TIME
        self._shown, self._at = self._at_host(host) + 2 * gain * off, host
        self.skew += gain * off / _TIME
        return passed

    def _strayed(self, off: float) -> float:
        """Note a frame that was far off [s]; return by how much our idea of its time changes."""
        if self._strays and (off > 0) != (self._strays[-1] > 0):
            self._strays.clear()
        self._strays.append(off)
        if len(self._strays) < _STRAYS:
            return 0.0
        periods = round(min(self._strays, key=abs) / self._period)
        jump = min(self._strays, key=abs) - periods * self._period
        self._shown += jump  # deadlines keep their distance to SYNC0
        self._zero += round(1e9 * periods * self._period)
        self._strays.clear()
        return -periods * self._period

    def _now(self) -> float:
        return self._at_host(self.host())

    def _at_host(self, host: float) -> float:
        return self._shown + (host - self._at) * (1 + self.skew)
