"""A planned motion of all joints over the whole time of a plan, by knots.

Trapezoids are parabolas between their corners, which cubics with stated slopes pass exactly; so a
stroke takes four knots, however long it is. Trajectories take `KNOTS` a period of the highest
harmonic, between which cubics are off by less than 2e-5 of its amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.prediction.information import partner_strokes
from hil.planning.strokes import REST
from hil.planning.trapezoid import Trapezoid
from hil.view.track import Track

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.planning.measurement import Measurement
    from hil.planning.strokes import Strokes

    Array = NDArray[np.float64]
    Rows = list[tuple[float, float, float]]

KNOTS = 24
"""Of a trajectory in each period of its highest harmonic."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Knots of all joints; joints stand still beyond their last one."""

    tracks: tuple[Track, ...]

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """q, qd and qdd at instants (n,), each of shape (n, n_joints)."""
        found = [_cubic(track, time) for track in self.tracks]
        q, qd, qdd = (np.column_stack(each) for each in zip(*found, strict=True))
        return q, qd, qdd


class MotionBuilder:
    """Collects the knots of a motion in the order of time.

    Parameters
    ----------
    start : sequence (n_joints,)
        Where it begins [rad or m].
    """

    def __init__(self, start: Sequence[float]) -> None:
        self._knots: list[Rows] = [[(0.0, float(q), 0.0)] for q in start]

    def place(self, joint: int) -> float:
        """Where a joint stands at last [rad or m]."""
        return self._knots[joint][-1][1]

    def move(self, joint: int, profile: Trapezoid, begin: float) -> None:
        """Let a joint follow a profile from `begin` on [s]."""
        if not profile.duration:
            return
        first, last = profile.window
        corners = np.unique([0.0, first, last, profile.duration])
        q, qd, _ = profile.motion(corners)
        self._knots[joint] += zip((begin + corners).tolist(), q.tolist(), qd.tolist(), strict=True)

    def travel(
        self, end: Sequence[float], velocity: Array, acceleration: Array, begin: float
    ) -> None:
        """Let all joints go to `end` at once, each at its own velocity and acceleration."""
        for joint, (target, v, a) in enumerate(zip(end, velocity, acceleration, strict=True)):
            self.move(joint, Trapezoid(self.place(joint), float(target), float(v), float(a)), begin)

    def measure(self, measurement: Measurement, begin: float) -> None:
        """Carry out a measurement from rest at its start."""
        if measurement.streamed:
            n = measurement.cycles * KNOTS * len(measurement.sine[0])
            time = np.linspace(0.0, measurement.cycles * measurement.period, n + 1)
            self._follow(begin + REST + time, *measurement.motion(time)[:2])
            return
        self._exercise(measurement, begin)
        begin += measurement.preparation
        for number, at in enumerate(measurement.beginnings[:-1]):
            self.move(measurement.index, measurement.profile(number), begin + at)
        for partner in measurement.partners:
            for at, profile in partner_strokes(measurement, partner):
                self.move(partner.index, profile, begin + at)

    def finish(self) -> Motion:
        """Return the motion."""
        return Motion(tuple(Track(*np.array(knots).T) for knots in self._knots))

    def _exercise(self, measurement: Strokes, begin: float) -> None:
        """Pairs of strokes, as many as end before the recording."""
        pair = [measurement.profile(number) for number in (0, 1)]
        took = sum(profile.duration for profile in pair)
        at = begin + measurement.preparation - measurement.exercised
        for _ in range(int(measurement.exercised / took)):
            for profile in pair:
                self.move(measurement.index, profile, at)
                at += profile.duration

    def _follow(self, time: Array, q: Array, qd: Array) -> None:
        """Pass configurations (n, n_joints) at instants (n,)."""
        rows = np.dstack([np.broadcast_to(time, q.T.shape), q.T, qd.T]).tolist()
        for knots, more in zip(self._knots, rows, strict=True):
            knots.extend(map(tuple, more))


def _cubic(track: Track, time: Array) -> tuple[Array, Array, Array]:
    """Value, rate and its rate by cubics between knots."""
    assert track.slope is not None  # noqa: S101 - planned motions state slopes
    last = np.clip(np.searchsorted(track.time, time, side="right") - 1, 0, None)
    following = np.minimum(last + 1, len(track.time) - 1)
    width = track.time[following] - track.time[last]
    moving = width > 0
    safe = np.where(moving, width, 1.0)
    s = np.where(moving, (time - track.time[last]) / safe, 0.0)
    way = track.value[following] - track.value[last]
    a, b = track.slope[last] * safe, track.slope[following] * safe
    c, d = 3 * way - 2 * a - b, a + b - 2 * way
    value = track.value[last] + s * (a + s * (c + s * d))
    rate = np.where(moving, a + s * (2 * c + 3 * s * d), 0.0) / safe
    return value, rate, np.where(moving, 2 * c + 6 * s * d, 0.0) / safe**2
