"""Information of a measurement about all base parameters, with friction eliminated.

The columns X of base parameters and common terms, and those of the friction of one measurement,
need no torque (`hil.friction.equation`). So the information X'X, with friction's columns projected
out of X as in the simultaneous estimator (`hil.estimation.condensed`), follows from the planned
motion.

Three more matrices describe the noise. The estimator is least squares, so the covariance of X'e is
X' E(e e') X, with e

- white torque noise, smoothed like all signals (`white`),
- an inertia times the error of accelerations from second differences of rounded positions,
  smoothed (`rounding`): of high frequency, so that much of it cancels where X changes slowly, and
- wandering friction: sign(v) times a random walk of the level, mostly absorbed by the terms
  sign(v) and sign(v) t (`wander`, for a walk of unit intensity).

As in the estimator, one of the samples within `APART` is used. The motion is smoothed instead of
the columns, which is equivalent for the samples used.

The samples follow from the planned profiles, for a trajectory from one period. Every axis follows
its trapezoids exactly, strokes follow each other after the expected turn, and a partner's strokes
are between two ramps of the creeping axis, as in the sequencer. Real servos round the corners of
the trapezoids; the estimator excludes samples there, and so does this prediction by the same rules
(`hil.friction.equation`): close to a reversal, and where the acceleration changes fast.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.friction.equation import FEWEST, term_columns, usable
from hil.least_squares.solving import orthonormal
from hil.least_squares.window import APART, rounding_window, smooth, weights, widen
from hil.planning.strokes import PARTNER_TURN, REST, SETTLED

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array, Mask
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMeasurement
    from hil.planning.prediction.noise import Differences
    from hil.planning.strokes import Partner, Strokes
    from hil.planning.trapezoid import Trapezoid

REACH = 1.0 / 30.0
"""Time near a reversal within which the filters are affected by it [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Share:
    """Information from an axis's torque in a measurement.

    Attributes
    ----------
    axis : int
        Index from 0.
    n : int
        Usable samples less eliminated coefficients.
    information, white, wander : ndarray, shape (n_base + N_COMMON, n_base + N_COMMON)
        X'X, and the covariance of X'e for white noise of 1 N m and for friction whose level walks
        by 1 N m in 1 s [1/(N m)^2 times that of the parameters].
    rounding : ndarray, of the same shape
        Covariance of X'e for white position errors of 1 rad on an inertia of 1 kg m^2.
    """

    axis: int
    n: int
    information: Array
    white: Array
    wander: Array
    rounding: Array

    def times(self, n: int) -> Share:
        """Return the information of `n` equal measurements with independent friction."""
        parts = (self.information, self.white, self.wander, self.rounding)
        return Share(self.axis, n * self.n, *(n * part for part in parts))


def shares(
    robot: Robot,
    measurement: ParameterMeasurement,
    period: float,
    differences: Differences | None = None,
    thinned: int = 1,
) -> list[Share]:
    """Compute the information of `measurement` per moved axis.

    Every period of a trajectory counts as a measurement, as it does for the estimator.

    Parameters
    ----------
    period : float
        Interval between samples [s].
    differences : Differences, optional
        Differences of rounded positions; exact positions by default.
    thinned : int
        Number of samples of which one is computed.
    """
    planned = forecast(measurement, thinned * period)
    found = (_share(robot, planned, axis, differences, thinned) for axis in measurement.moved)
    alike = measurement.cycles if measurement.streamed else 1
    return [share.times(alike) for share in found if share is not None]


def _share(
    robot: Robot, planned: Forecast, axis: int, differences: Differences | None, thinned: int
) -> Share | None:
    every = max(1, round(APART / planned.period))
    used = usable(robot, planned, axis, thinned)[::every]
    if every * used.sum() < FEWEST:
        return None
    taken = planned.thin(every)
    rows, common, friction = term_columns(robot, taken, axis)
    columns = np.column_stack([rows, common])
    basis, _ = orthonormal(friction[used])
    X = np.zeros_like(columns)
    X[used] = columns[used] - basis @ (basis.T @ columns[used])
    later = np.cumsum((X * friction[:, :1])[::-1], axis=0)
    exact, kept = weights(planned.period), 1.0 if differences is None else differences.kept[axis]
    white, products = _smoothed_noise(X, exact, every), X.T @ X
    return Share(
        axis=axis,
        n=round(kept * every * int(used.sum())) - basis.shape[1],
        information=kept * every * products,
        white=every**2 * _thin(white, exact @ exact * products, kept),
        wander=(kept * every) ** 2 * taken.period * later.T @ later,
        rounding=every**2 * _rounding_covariance(X, products, taken.period, differences, kept),
    )


def _rounding_covariance(
    X: Array, products: Array, apart: float, differences: Differences | None, kept: float
) -> Array:
    if differences is None:
        return np.zeros_like(products)
    window = rounding_window(differences.period)
    whole = _smoothed_noise(X, window, max(1, round(apart / differences.period)))
    return _thin(whole, window @ window * products, kept)


def _thin(whole: Array, alone: Array, kept: float) -> Array:
    """Compute the covariance if only a random share `kept` of the samples is used.

    Common noise is not in the samples `alone`: noise of a random selection does not cancel.
    """
    return kept**2 * whole + kept * (1.0 - kept) * alone


def _smoothed_noise(X: Array, window: Array, every: int) -> Array:
    """Compute the covariance of X'e for filtered white noise, with one of `every` samples used."""
    alike = np.correlate(window, window, mode="full")[len(window) - 1 :: every]
    later = alike[0] / 2 * X
    for apart, share in enumerate(alike[1:], start=1):
        later[:-apart] += share * X[apart:]
    half = X.T @ later
    return np.asarray(half + half.T)


@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """Planned motion of a measurement on an even time grid.

    Attributes
    ----------
    period : float
        Sample period [s].
    time : ndarray, shape (n,)
        Time [s].
    q, qd, qdd : ndarray, shape (n, n_joints)
        Positions, velocities and accelerations [rad], [rad/s], [rad/s^2].
    """

    period: float
    time: Array
    q: Array
    qd: Array
    qdd: Array

    @property
    def link(self) -> tuple[Array, Array, Array]:
        """Motion of the links, q, qd and qdd, equal to the motors' for rigid gears."""
        return self.q, self.qd, self.qdd

    def thin(self, every: int) -> Forecast:
        """Return one of `every` samples, with smoothed velocities and accelerations."""
        kept = np.s_[::every]
        moved = self.q[kept], self.smoothed(self.qd)[kept], self.smoothed(self.qdd)[kept]
        return Forecast(every * self.period, self.time[kept], *moved)

    def smoothed(self, x: Array) -> Array:
        """Weighted mean over the estimator's window along the first axis."""
        return smooth(x, self.period)

    def away_from(self, excluded: Mask) -> Mask:
        """Return True for samples further than `REACH` from the `excluded` ones."""
        return ~widen(excluded, max(2, round(REACH / self.period)))


def forecast(measurement: ParameterMeasurement, period: float) -> Forecast:
    """Sample the planned motion of `measurement` every `period` [s]."""
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
    """Move an axis by `profile` from `begin` on, and hold the final position."""
    first, last = np.searchsorted(time, (begin, begin + profile.duration))
    motion[0][last:, axis] = profile.end
    for wanted, found in zip(motion, profile.motion(time[first:last] - begin), strict=True):
        wanted[first:last, axis] = found


def partner_strokes(measurement: Strokes, partner: Partner) -> Iterator[tuple[float, Trapezoid]]:
    """Yield the partner's strokes that fit during the creep of the read axis.

    Yields
    ------
    tuple of float and Trapezoid
        Start of a stroke since the start of the recording [s], and its profile.
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
