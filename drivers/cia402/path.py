"""A path of set-points, passed at its own pace or slowed down along itself.

Whoever sends set-points may be late, and whoever supervises the axes may be away. Then the path is
not left: the same points q(s) are passed more slowly, s being the number of a set-point and r <= 1
the pace at which it grows. With q' and q'' by the path's own time, an axis has

    velocity r q',  acceleration r^2 q'' + q' dr/dt,

so the pace may change by what the acceleration limit a leaves to every axis,

    -(a + q'' r^2) <= q' dr/dt <= a - q'' r^2.

A drive whose set-points stay out stops at the last one at once, but its axis slows down by a at
most: it overruns that set-point, by v^2 / 2a where it comes to rest. When set-points come again,
the pace has lost what the axes have: a t / |q'| in a time t, so that they are led on as they move.

While set-points stay out drives brake, and must regain that with torque that the path may need. So
the path is passed the more slowly the greater the share s of the time is for which they did lately,
however little each was late,

    r <= S / s.

Where axes have come to rest they may again, so a path is passed with caution for a while: no axis
overruns by more than its following error window w,

    r |q'| <= sqrt(2 a w).

At a quarter of such a pace a late set-point does no harm. So however often they are late, nothing
else than the limits of acceleration keeps the pace from growing to that again.

What is fed forward is passed alike: velocity by r; of the torque, what holds the axes counts as it
is and the rest, by acceleration and speed, by r^2.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SHARE = 0.9
"""Of what the acceleration limits leave; the rest is for the steps in which a pace changes."""

RECOVERY = 0.3
"""Time in which the pace goes from rest to the path's own at the least, where late set-points would
do harm [s]."""

GENTLE = 0.25
"""Share of the pace at which an axis overruns by its window: of 0.15 to 1, the one that passes an
exciting trajectory soonest while torques are beyond 95 % of their limit for less than a sixth of
the time, 5 to 42 % of the SYNCs being late by 10 ms on average; a share of 1 is ended by trips."""

OUT, LATELY = 0.04, 1.0
"""Share of the time for which set-points may stay out, and time over which it is taken [s]. A
computer in real time stays far below (0.16 ms of each 4). At 0.1 and its own pace an axis of the
virtual plant that needed most of its torque fell behind by its window, and was ended for it."""

STILL = 1.5
"""Periods by which set-points may be late before drives have come to rest at the last ones."""

MEMORY = 10.0
"""Time for which a path is passed with caution [s]: what keeps a computer busy comes back within
seconds, if it comes back at all."""


class Path:
    """Set-points of all axes, and where along them the last ones stand that were sent.

    Parameters
    ----------
    points : ndarray, shape (n, n_axes)
        A set-point of each axis every period, not rounded; at rest at both ends [increments].
    accelerations : sequence of float, length n_axes
        Limits [increments/s^2].
    windows : sequence of float, length n_axes
        Of the following error [increments].
    period : float
        Between two set-points [s].
    offsets : ndarray, shape (n, n_axes, 3), optional
        Velocity [the drive's unit], torque and the part of it that holds the axes [per mille of
        rated].

    Attributes
    ----------
    at : float
        Number of the last set-points, from 0; between two of them where the path was slowed down.
    pace : float
        Set-points passed in a period, 0 to 1.
    slowed : int
        Periods in which it was below 1.
    out : float
        Time for which set-points stayed out lately [s]; what is long past counts less.
    caution : float
        Time for which set-points may be expected to stay out again [s].
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
        """The last set-points have been reached."""
        return self.at >= self._last

    @property
    def exact(self) -> Array:
        """The set-points that stand at `at`, not rounded, shape (n_axes,)."""
        k = int(self.at)
        f = self.at - k
        a, b, c, d = self._exact[min(k, self._last) : min(k, self._last) + 4]
        # a cubic with the slopes of the chords beside it
        q: Array = b + f / 2 * (c - a + f * (2 * a - 5 * b + 4 * c - d + f * (3 * (b - c) + d - a)))
        return q

    @property
    def overrun(self) -> tuple[Array, float]:
        """How far each axis overruns the last set-point if no other comes, until it is back [s]."""
        before, _, after = self._around
        speed = self.pace * (after - before) / (2 * self._period)
        way: Array = np.sign(speed) * speed**2 / (2 * self._limits)
        return way, float((2 * np.abs(speed) / self._limits).max())

    @property
    def _quickest(self) -> float:
        """How fast the pace may change by the limits of acceleration [1/s]."""
        before, _, after = self._around
        with np.errstate(divide="ignore"):
            return float((self._limits * 2 * self._period / np.abs(after - before)).min())

    @property
    def _around(self) -> Array:
        """Set-points one before `at`, next to it and one after it, shape (3, n_axes)."""
        k = min(round(self.at), self._last)
        return self._exact[k : k + 3]

    def go_on(self, before: Path, at: float) -> None:
        """Go on at a place of this path as one before it was passed."""
        self.at, self.pace = at, before.pace
        self.out, self.caution = before.out, before.caution

    @property
    def targets(self) -> list[int]:
        """The set-points that stand at `at`, length n_axes [increments]."""
        k = int(self.at)
        if k == self.at:
            return list(self._rounded[k])
        return list(_whole(self.exact))

    @property
    def fed(self) -> list[list[int]]:
        """Velocity and torque fed forward at `at` to each axis; empty where nothing is."""
        if self._offsets is None:
            return []
        k, r = int(self.at), self.pace
        f = self.at - k
        velocity, torque, holding = ((1 - f) * self._offsets[k] + f * self._offsets[k + 1]).T
        counts = np.stack([r * velocity, holding + r**2 * (torque - holding)], axis=1)
        return list(_whole(counts))

    def step(self, *, calm: bool = False) -> None:
        """Go on by one period.

        Parameters
        ----------
        calm : bool
            Slow down to rest; otherwise the path's own pace is taken up again.
        """
        before = self.pace
        self.out -= self.out * self._period / LATELY
        if calm or self.caution > 0.0 or self.out > OUT * LATELY or before < 1.0:
            self._change(calm=calm)
            self.caution -= self._period
            self.slowed += min(before, self.pace) < 1.0
        self.at = min(self.at + (before + self.pace) / 2, self._last)

    def late(self, time: float) -> None:
        """Take note by how much set-points were late [s]: axes have braked, or come to rest."""
        self.out = min(self.out + time, LATELY)
        if time > STILL * self._period:
            self.pace, self.caution = max(self.pace - self._quickest * time, 0.0), MEMORY

    def _change(self, *, calm: bool) -> None:
        """Let the pace approach the one that is aimed at as fast as all axes can follow."""
        a, b, c = self._around
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
