"""Predicted standard deviation of every base parameter for a plan.

The information of the measurements is summed as in the simultaneous estimator
(`hil.estimation.simultaneous`): each axis weighted with the reciprocal of its torque noise,
friction eliminated by measurement (`hil.planning.prediction.information`), the common terms of each
axis as nuisance. With the information N and the covariance S of the noise in the normal equations,
the estimate's covariance is N^-1 S N^-1. For white noise alone that is N^-1; wandering friction
makes S larger, most of all for measurements of gravity, which depend on the difference between
strokes.

A parameter's standard deviation says little without a scale. Its effect is the equivalent torque,
as share of the torque limit of the axis with the largest share, root mean square over motions
through the whole range of the robot. A parameter with an effect above `IMPRECISE` is imprecise.

Uncertain torque constants and delays of the currents cannot be predicted and are not included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.friction.equation import n_unknowns, place
from hil.least_squares.solving import IDENTIFIABLE, inverse, nuisance_elimination, undetermined
from hil.least_squares.uncertainty import sandwich
from hil.least_squares.window import APART
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.planning.halton import halton
from hil.planning.measurement import shows_parameters
from hil.planning.prediction.information import shares

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.arrays import Array, Mask
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.prediction.information import Share
    from hil.planning.prediction.noise import Noise


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
