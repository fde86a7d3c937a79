"""Trapezoidal velocity profile from any motion to rest, as in a drive's profile position mode.

An axis at q0 with velocity v0 is to come to rest at a target at distance D (in the direction s of
its final motion). It changes its speed to the peak, at most the profile velocity,

    peak^2 = a D + v0^2 / 2,

cruises, and brakes, all with the acceleration a. If v0 leads away from the target, or beyond it, s
is the direction of the target from the place where the axis has braked, so that it turns round.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Trapezoid:
    """Trapezoidal profile of an axis.

    Parameters
    ----------
    start, speed : float
        Initial position and velocity.
    target : float
        Final position.
    velocity, acceleration : float
        Profile velocity and acceleration, positive.
    """

    def __init__(
        self, start: float, speed: float, target: float, velocity: float, acceleration: float
    ) -> None:
        braked = start + speed * abs(speed) / (2 * acceleration)
        sign = math.copysign(1.0, target - braked)
        v0, way = sign * speed, sign * (target - start)
        peak = min(velocity, math.sqrt(max(0.0, acceleration * way + v0**2 / 2)))
        first, last = abs(peak - v0) / acceleration, peak / acceleration
        rising = math.copysign(acceleration, peak - v0)
        left = way - (v0 + peak) / 2 * first - peak / 2 * last
        cruise = max(0.0, left) / peak if peak > 0 else 0.0
        self.duration = first + cruise + last
        self._start, self._speed, self._target = start, speed, target
        self._ends = np.array([first, first + cruise, self.duration])
        self._rates = sign * np.array([rising, 0.0, -acceleration])

    def motion(self, t: Array) -> tuple[Array, Array]:
        """Return positions and velocities at times since the start, each of the shape of `t`."""
        q, v = np.full(t.shape, self._start), np.full(t.shape, self._speed)
        begin = 0.0
        for end, rate in zip(self._ends, self._rates, strict=True):
            spent = np.clip(t - begin, 0.0, end - begin)
            q += v * spent + rate * spent**2 / 2
            v += rate * spent
            begin = end
        over = t >= self.duration
        return np.where(over, self._target, q), np.where(over, 0.0, v)
