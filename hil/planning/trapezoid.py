"""Velocity trapezoids: motion of a drive in profile position mode.

A move from `start` to `end` accelerates with a constant acceleration to the profile velocity,
cruises and decelerates likewise. If the distance is shorter than both ramps, the trapezoid becomes
a triangle and the profile velocity is never reached. Plan, dry run and checks of a recording
compute durations, windows and excitation from here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from hil.arrays import Array


@dataclass(frozen=True)
class Trapezoid:
    """Move from rest to rest.

    Attributes
    ----------
    start, end : float
        Positions at the beginning and the end [rad, or m].
    velocity, acceleration : float
        Profile velocity and acceleration, both positive [rad/s, rad/s^2].
    """

    start: float
    end: float
    velocity: float
    acceleration: float

    @property
    def distance(self) -> float:
        """Length of the move, never negative [rad]."""
        return abs(self.end - self.start)

    @cached_property
    def peak(self) -> float:
        """Highest speed of the move [rad/s]."""
        return min(self.velocity, math.sqrt(self.distance * self.acceleration))

    @property
    def ramp_time(self) -> float:
        """Duration of a ramp [s]."""
        return self.peak / self.acceleration

    @property
    def ramp(self) -> float:
        """Length of a ramp [rad]."""
        return self.peak**2 / (2 * self.acceleration)

    @cached_property
    def duration(self) -> float:
        """Time from rest to rest [s]."""
        if not self.peak:
            return 0.0
        return self.distance / self.peak + self.ramp_time

    @cached_property
    def window(self) -> tuple[float, float]:
        """Begin and end of constant velocity [s]; equal for a triangle."""
        return self.ramp_time, max(self.ramp_time, self.duration - self.ramp_time)

    @property
    def _sign(self) -> float:
        return math.copysign(1.0, self.end - self.start)

    def motion(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Compute q, qd and qdd at times `t` (any shape) since the start; at rest outside."""
        times = np.asarray(t, dtype=float)
        (begin, end), duration, peak = self.window, self.duration, self.peak

        # elapsed time in the first ramp, the cruise and the last ramp [s]
        def spent(since: float, until: float) -> Array:
            return np.minimum(np.maximum(times - since, 0.0), until - since)

        first, second, third = spent(0.0, begin), spent(begin, end), spent(end, duration)
        way = (
            self.acceleration * first**2 / 2
            + peak * (second + third)
            - self.acceleration * third**2 / 2
        )
        rising = (times >= 0) & (times < begin)
        falling = (times >= end) & (times < duration)
        rate = self._sign * self.acceleration
        q, qd = self.start + self._sign * way, rate * (first - third)
        return q, qd, rate * (rising.astype(float) - falling)

    def q(self, t: ArrayLike) -> Array:
        """Compute the position at times `t` (any shape) since the start [rad]."""
        return self.motion(t)[0]
