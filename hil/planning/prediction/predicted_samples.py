"""What a measurement will sample, from its profiles alone; of a trajectory one period.

Every axis follows its trapezoids exactly, strokes follow each other after the expected turn, and a
partner keeps to the sequencer's rule: its strokes lie between two ramps of the creeping axis. Real
servos round the corners of the trapezoids; samples there are of no use to the estimator anyway and
are left out here by the same rules (`hil.least_squares.terms`): close to a reversal, and where the
acceleration changes fast.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.window import smooth, widened
from hil.planning.strokes import PARTNER_TURN, REST, SETTLED

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from hil.planning.measurement import ParameterMeasurement
    from hil.planning.strokes import Partner, Strokes
    from hil.planning.trapezoid import Trapezoid

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

REACH = 1.0 / 30.0
"""How far samples near a reversal spoil others [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """The planned motion of one measurement on an even grid of time.

    Attributes
    ----------
    period : float
        Between samples [s].
    time : ndarray, shape (n,)
        [s].
    q, qd, qdd : ndarray, shape (n, n_joints)
        [rad], [rad/s], [rad/s^2].
    """

    period: float
    time: Array
    q: Array
    qd: Array
    qdd: Array

    @property
    def link(self) -> tuple[Array, Array, Array]:
        """q, qd and qdd of the links: gears count as rigid."""
        return self.q, self.qd, self.qdd

    def thinned(self, every: int) -> Forecast:
        """One of `every` samples, smoothed; of positions the window leaves what they are."""
        kept = np.s_[::every]
        moved = self.q[kept], self.smoothed(self.qd)[kept], self.smoothed(self.qdd)[kept]
        return Forecast(every * self.period, self.time[kept], *moved)

    def smoothed(self, x: Array) -> Array:
        """Weighted mean over the estimator's window along the first axis."""
        return smooth(x, self.period)

    def away_from(self, excluded: Mask) -> Mask:
        """Samples further than `REACH` from the `excluded` ones."""
        return ~widened(excluded, max(2, round(REACH / self.period)))


def forecast(measurement: ParameterMeasurement, period: float) -> Forecast:
    """Plan the samples of `measurement`, one every `period` [s]."""
    if measurement.streamed:
        instants = np.arange(0.0, measurement.period, period)
        return Forecast(period, instants, *measurement.motion(instants))
    beginnings = measurement.beginnings
    n = round((beginnings[-1] + REST) / period)
    time = period * np.arange(n, dtype=np.float64)
    q = np.tile(np.array(measurement.start), (n, 1))
    motion = (q, np.zeros_like(q), np.zeros_like(q))
    for number, begin in enumerate(beginnings[:-1]):
        _add(motion, measurement.index, measurement.profile(number), time, begin)
    for partner in measurement.partners:
        for begin, profile in partner_strokes(measurement, partner):
            _add(motion, partner.index, profile, time, begin)
    return Forecast(period, time, *motion)


def _add(
    motion: tuple[Array, Array, Array], axis: int, profile: Trapezoid, time: Array, begin: float
) -> None:
    """Let one axis follow `profile` from `begin` on, and stay where it leads to."""
    first, last = np.searchsorted(time, (begin, begin + profile.duration))
    motion[0][last:, axis] = profile.end
    for wanted, found in zip(motion, profile.motion(time[first:last] - begin), strict=True):
        wanted[first:last, axis] = found


def partner_strokes(measurement: Strokes, partner: Partner) -> Iterator[tuple[float, Trapezoid]]:
    """Strokes of the partner while the other axis creeps, as many as fit.

    Yields
    ------
    tuple of float and Trapezoid
        When a stroke begins, since the recording does [s], and its profile.
    """
    number = 0
    for each, begin in enumerate(measurement.beginnings[:-1]):
        first, last = (begin + t for t in measurement.profile(each).window)
        due = first + SETTLED
        duration = partner.profile(measurement.q, 0).duration
        while due <= last - duration - PARTNER_TURN:
            yield due, partner.profile(measurement.q, number)
            due += duration + PARTNER_TURN
            number += 1
