"""Path of set-points, passed at full pace or slowed down.

Set-points may be sent late, and the supervision may be interrupted. The axes then stay on the path:
the same points q(s) are passed more slowly, with s the index of a set-point and r <= 1 the pace at
which s grows. With q' and q'' the derivatives by the path's own time, an axis has

    velocity r q',  acceleration r^2 q'' + q' dr/dt,

so the acceleration limit a of every axis bounds the change of pace,

    -(a + q'' r^2) <= q' dr/dt <= a - q'' r^2.

A drive without new set-points stops at the last one, but its axis slows down by a at most: it
overruns that set-point, by v^2 / 2a until rest. When set-points come again, the pace has dropped
like the speed of the axes, by a t / |q'| in a time t, so that they are led on as they move.

Without set-points drives brake, and recover with torque that the path may need. Hence the pace is
reduced with the recent share s of time without set-points, however short each gap was,

    r <= S / s.

After axes have come to rest, the path is passed with caution for a while: no axis may overrun by
more than its following error window w,

    r |q'| <= sqrt(2 a w).

At a quarter of such a pace a late set-point does no harm. So up to that pace only the acceleration
limits restrict its recovery, even if set-points are often late.

Feed-forward is scaled alike: velocity by r; the holding part of the torque is kept, and the rest,
due to acceleration and speed, is scaled by r^2.

A move without a path has a trapezoidal velocity profile from any motion to rest, as in a drive's
profile position mode. An axis at q0 with velocity v0 is to come to rest at a target at distance D
(in the direction s of its final motion). It changes its speed to the peak, at most the profile
velocity,

    peak^2 = a D + v0^2 / 2,

cruises, and brakes, all with the acceleration a. If v0 leads away from the target, or beyond it, s
is the direction of the target from the place where the axis has braked, so that it turns round.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

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


SHARE = 0.9
"""Used share of the acceleration limits; the rest is a margin for the steps of the pace."""

RECOVERY = 0.3
"""Minimum time from rest to full pace where late set-points are harmful [s]."""

GENTLE = 0.25
"""Harmless pace, as a share of the pace at which an axis overruns by its window. Tried were shares
from 0.15 to 1 with 5 to 42 % of SYNCs late by 10 ms: up to 0.25, torques exceed 95 % of the limit
for less than a sixth of an exciting trajectory; at 1, axes trip."""

OUT, LATELY = 0.04, 1.0
"""Largest share of time without set-points at full pace, and its averaging time [s]. With real-time
scheduling the share stays far below (0.16 ms of each 4). At 0.1 and full pace, an axis of the
virtual plant near its torque limit exceeded its window and tripped."""

STILL = 1.5
"""Delay of set-points after which drives have come to rest at the last ones [periods]."""

MEMORY = 10.0
"""Duration of caution [s]: disturbances of a computer recur within seconds, if at all."""


class Path:
    """Set-points of the axes, and the present position on the path.

    Parameters
    ----------
    points : ndarray, shape (n, n_axes)
        A set-point of each axis every period, not rounded; at rest at both ends [increments].
    accelerations : sequence of float, length n_axes
        Acceleration limits [increments/s^2].
    windows : sequence of float, length n_axes
        Following error windows [increments].
    period : float
        Time between two set-points [s].
    offsets : ndarray, shape (n, n_axes, 3), optional
        Velocity [drive's unit], torque and its holding part [per mille of rated].

    Attributes
    ----------
    at : float
        Index of the last set-points, from 0; a fraction where the path was slowed down.
    pace : float
        Set-points passed in a period, 0 to 1.
    slowed : int
        Periods with a pace below 1.
    out : float
        Recent time without set-points [s], with exponential forgetting.
    caution : float
        Remaining time of caution after the axes have come to rest [s].
    """

    def __init__(
        self,
        points: Array,
        accelerations: Sequence[float],
        windows: Sequence[float],
        period: float,
        offsets: Array | None = None,
    ) -> None:
        self.at = 0.0
        self.pace = 1.0
        self.slowed = 0
        self.out = self.caution = 0.0
        self._period = period
        self._exact = np.vstack([points[:1], points, points[-1:], points[-1:]])
        self._offsets = None if offsets is None else np.vstack([offsets, offsets[-1:]])
        self._rounded = _whole(points)
        self._limits = np.asarray(accelerations, dtype=float)
        self._stops_within = np.sqrt(2 * self._limits * np.asarray(windows))
        self._last = len(points) - 1

    @property
    def ended(self) -> bool:
        """True if the last set-points are reached."""
        return self.at >= self._last

    @property
    def exact(self) -> Array:
        """Set-points at `at`, not rounded, shape (n_axes,)."""
        k = int(self.at)
        f = self.at - k
        a, b, c, d = self._exact[min(k, self._last) : min(k, self._last) + 4]
        # a cubic with the slopes of the adjacent chords
        q: Array = b + f / 2 * (c - a + f * (2 * a - 5 * b + 4 * c - d + f * (3 * (b - c) + d - a)))
        return q

    @property
    def overrun(self) -> tuple[Array, float]:
        """Overrun of each axis without further set-points, and the time until return [s]."""
        before, _, after = self._neighbours
        speed = self.pace * (after - before) / (2 * self._period)
        overrun: Array = np.sign(speed) * speed**2 / (2 * self._limits)
        return overrun, float((2 * np.abs(speed) / self._limits).max())

    @property
    def _neighbours(self) -> Array:
        """Set-points before, at and after the one nearest to `at`, shape (3, n_axes)."""
        k = min(round(self.at), self._last)
        return self._exact[k : k + 3]

    def go_on(self, before: Path, at: float) -> None:
        """Continue at index `at` of this path with the pace of the previous path."""
        self.at, self.pace = at, before.pace
        self.out, self.caution = before.out, before.caution

    @property
    def targets(self) -> list[int]:
        """Set-points at `at`, rounded, length n_axes [increments]."""
        k = int(self.at)
        if k == self.at:
            return list(self._rounded[k])
        return list(_whole(self.exact))

    @property
    def fed(self) -> list[list[int]]:
        """Velocity and torque offsets at `at` of each axis; empty without feed-forward."""
        if self._offsets is None:
            return []
        k, r = int(self.at), self.pace
        f = self.at - k
        velocity, torque, holding = ((1 - f) * self._offsets[k] + f * self._offsets[k + 1]).T
        counts = np.stack([r * velocity, holding + r**2 * (torque - holding)], axis=1)
        return list(_whole(counts))

    def step(self, *, calm: bool = False) -> None:
        """Advance by a period.

        Parameters
        ----------
        calm : bool
            True to slow down to rest; otherwise full pace is resumed.
        """
        before = self.pace
        self.out -= self.out * self._period / LATELY
        if calm or self.caution > 0.0 or self.out > OUT * LATELY or before < 1.0:
            self._change(calm=calm)
            self.caution -= self._period
            self.slowed += min(before, self.pace) < 1.0
        self.at = min(self.at + (before + self.pace) / 2, self._last)

    def note_late(self, time: float) -> None:
        """Record the delay of set-points [s]: axes have braked, or come to rest."""
        self.out = min(self.out + time, LATELY)
        if time > STILL * self._period:
            before, _, after = self._neighbours
            with np.errstate(divide="ignore"):
                loss = (self._limits * 2 * self._period / np.abs(after - before)).min() * time
            self.pace, self.caution = max(self.pace - float(loss), 0.0), MEMORY

    def _change(self, *, calm: bool) -> None:
        """Change the pace towards full pace or rest within the axes' acceleration limits."""
        a, b, c = self._neighbours
        speed = (c - a) / (2 * self._period)
        bend = (c - 2 * b + a) / self._period**2 * np.sign(speed) * self.pace**2
        with np.errstate(divide="ignore"):
            slower, faster = (SHARE * (self._limits + s * bend) / np.abs(speed) for s in (1, -1))
            stopping = (self._stops_within / np.abs(speed)).min()
        harmless = min(GENTLE * stopping, 1.0)
        aim = max(OUT * LATELY / max(self.out, OUT * LATELY), harmless)
        if self.caution > 0.0:
            aim = min(aim, stopping)
        if calm:
            aim = 0.0
        recovery = math.inf if self.pace < harmless else 1 / RECOVERY
        least = self.pace - max(slower.min(), 0.0) * self._period
        most = self.pace + min(max(faster.min(), 0.0), recovery) * self._period
        self.pace = min(max(aim, least, 0.0), most)


def _whole(values: Array) -> Any:
    return np.rint(values).astype(np.int64).tolist()
