"""Information of measurements about all base parameters, and predicted precision.

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

For the predicted standard deviations (`precision`) the information of the measurements is summed as
in the simultaneous estimator (`hil.estimation.simultaneous`): each axis weighted with the
reciprocal of its torque noise, friction eliminated by measurement, the common terms of each axis as
nuisance. With the information N and the covariance S of the noise in the normal equations, the
estimate's covariance is N^-1 S N^-1. For white noise alone that is N^-1; wandering friction makes S
larger, most of all for measurements of gravity, which depend on the difference between strokes.

A parameter's standard deviation says little without a scale. Its effect is the equivalent torque,
as share of the torque limit of the axis with the largest share, root mean square over motions
through the whole range of the robot. A parameter with an effect above `IMPRECISE` is imprecise.

Uncertain torque constants and delays of the currents cannot be predicted and are not included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.friction.equation import FEWEST, n_unknowns, place, term_columns, usable
from hil.least_squares.solving import (
    IDENTIFIABLE,
    inverse,
    nuisance_elimination,
    orthonormal,
    undetermined,
)
from hil.least_squares.window import APART, rounding_window, smooth, weights, widen
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.planning.halton import halton
from hil.planning.measurement import shows_parameters
from hil.planning.strokes import PARTNER_TURN, REST, SETTLED

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array, Mask
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement, ParameterMeasurement
    from hil.planning.prediction.noise import Differences, Noise
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
    rounding = np.zeros_like(products)
    if differences is not None:
        window = rounding_window(differences.period)
        whole = _smoothed_noise(X, window, max(1, round(taken.period / differences.period)))
        rounding = _thin(whole, window @ window * products, kept)
    return Share(
        axis=axis,
        n=round(kept * every * int(used.sum())) - basis.shape[1],
        information=kept * every * products,
        white=every**2 * _thin(white, exact @ exact * products, kept),
        wander=(kept * every) ** 2 * taken.period * later.T @ later,
        rounding=every**2 * rounding,
    )


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


IMPRECISE = 0.001
"""Bound of the effect of an imprecise parameter's standard deviation, as share of a limit."""


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    """Information of measurements about base parameters and the axes' common terms.

    Attributes
    ----------
    matrix : ndarray, shape (n, n)
        Matrix of the weighted normal equations.
    scatter : ndarray, shape (n, n)
        Covariance of the right-hand side of the normal equations.
    """

    matrix: Array
    scatter: Array

    def __add__(self, other: Information) -> Information:
        return Information(self.matrix + other.matrix, self.scatter + other.scatter)


@dataclass(frozen=True, slots=True, eq=False)
class Precision:
    """Predicted standard deviations of base parameters.

    Attributes
    ----------
    deviation : ndarray, shape (n_base,)
        Standard deviations; inf for unidentifiable parameters.
    effect : ndarray, shape (n_base,)
        Torque equivalent to a standard deviation, as a share of the axis's limit.
    source : str
        Source of the noise figures.
    """

    deviation: Array
    effect: Array
    source: str

    @property
    def imprecise(self) -> Mask:
        """Mask of imprecise parameters, shape (n_base,)."""
        return self.effect > IMPRECISE


def predict(
    robot: Robot, measurements: Sequence[Measurement], period: float, noise: Noise
) -> Precision:
    """Predict the standard deviations for `measurements` sampled every `period` [s]."""
    found = information(robot, measurements, period, noise)
    return precision(robot, found, noise.sampled(robot, period).source)


def precision(robot: Robot, known: Information, source: str) -> Precision:
    """Compute standard deviations from the information `known`."""
    deviation = np.sqrt(np.diag(covariance(known, len(base_parameters(robot)))))
    return Precision(deviation, deviation * torque_scale(robot), source)


def information(
    robot: Robot, measurements: Sequence[Measurement], period: float, noise: Noise
) -> Information:
    """Compute the information of the `measurements` used by the simultaneous estimator.

    For strokes, means over the estimator's decimation are used, which is equivalent and faster;
    trajectories are evaluated sample by sample, because corners may be anywhere.
    """
    each, noise = max(1, round(APART / period)), noise.sampled(robot, period)
    useful = [m for m in measurements if shows_parameters(m)]
    differences = noise.differences
    strokes = (
        s for m in useful if not m.streamed for s in shares(robot, m, each * period, differences)
    )
    trajectories = (s for m in useful if m.streamed for s in shares(robot, m, period, differences))
    return add_up(robot, strokes, noise.mean(each)) + add_up(robot, trajectories, noise)


def add_up(robot: Robot, found: Iterable[Share], noise: Noise) -> Information:
    """Sum the information of shares under `noise`."""
    n = n_unknowns(robot)
    matrix, scatter = np.zeros((n, n)), np.zeros((n, n))
    for share in found:
        at = np.ix_(place(robot, share.axis), place(robot, share.axis))
        matrix[at] += share.information / noise.variance[share.axis]
        scatter[at] += scatter_of(share, noise)
    return Information(matrix, scatter)


def scatter_of(share: Share, noise: Noise) -> Array:
    """Compute the weighted covariance of a share's right-hand side."""
    axis = share.axis
    scatter: Array = noise.white[axis] * share.white + noise.walk[axis] * share.wander
    if noise.rounding is not None:
        scatter += noise.acceleration_variance[axis] * share.rounding
    weighted: Array = scatter / noise.variance[axis] ** 2
    return weighted


def covariance(known: Information, n_base: int) -> Array:
    """Compute the covariance of the base parameters, shape (n_base, n_base); inf if unknown."""
    from hil.least_squares.uncertainty import sandwich  # noqa: PLC0415 - loads scipy

    P = nuisance_elimination(known.matrix, n_base)
    left, alone = P @ known.matrix[:, :n_base], np.diag(known.matrix)[:n_base]
    found = sandwich(inverse(left, IDENTIFIABLE, alone), sandwich(P, known.scatter))
    lost = undetermined(left, IDENTIFIABLE, alone)
    found[lost, lost] = np.inf
    return found


def torque_scale(robot: Robot) -> Array:
    """Compute the torque per unit of every base parameter, as share of an axis's limit, (n_base,).

    The torque is a root mean square over instants that cover ranges, speeds and accelerations of
    all joints up to the limits; the axis with the largest share counts.
    """
    A = regressor(robot, *whole_range(robot))
    scale: Array = (np.sqrt(np.mean(A**2, axis=0)) / robot.torque_limit[:, np.newaxis]).max(axis=0)
    return scale


def whole_range(robot: Robot) -> tuple[Array, Array, Array]:
    """Return instants spread over ranges, speeds and accelerations of all joints: q, qd and qdd."""
    n = robot.n_joints
    # relative error of a mean over 512 points of a low-discrepancy sequence: some 1/512
    points = 2 * halton(512, 3 * n) - 1
    middle, half = (robot.q_min + robot.q_max) / 2, (robot.q_max - robot.q_min) / 2
    return (
        middle + half * points[:, :n],
        robot.velocity_limit * points[:, n : 2 * n],
        robot.acceleration_limit * points[:, 2 * n :],
    )
