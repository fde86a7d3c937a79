"""Fit base parameters to the half-sums and half-differences of all pairs (step 2).

Half-sums and half-differences of an axis are two channels of one regression with common unknowns:
friction not represented by a function of the speed, such as load-dependent friction, affects the
half-differences alone. Rows are weighted by the number of samples, channels by the residual
variance. Levels of friction of each recording are eliminated with these weights.

Friction fluctuations and noise differ from one pair of strokes to the next: pairs are groups. Model
errors repeat with the strokes, but differ between regions of the state space: the scatter over
cells of states is added (`hil.least_squares.regression`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.back_and_forth.excitation import Excitation, excitation
from hil.estimation.back_and_forth.halves import COMMON, known, numbered_pairs
from hil.estimation.condensed import drive_torques
from hil.estimation.free_motion.accumulation import cells_of
from hil.least_squares.blocks import Blocks
from hil.least_squares.layout import axis_names
from hil.least_squares.normal_equations import reweighted
from hil.least_squares.regression import ROUNDS, Regression
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.back_and_forth.halves import Halves
    from hil.least_squares.regression import Covariance, Fit
    from hil.model.robot import Robot

BLOCKS = 200
"""Largest number of blocks of successive pairs: friction drifts over more than one pair, and 200
blocks determine a variance within 5 %, 1 / sqrt(2 * 200).
"""


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Solution of the regression over half-sums and half-differences.

    Attributes
    ----------
    fit : Fit
        Base parameters, and direction-dependent terms by axis; zero if not kept.
    excitation : Excitation
    weights : ndarray, shape (2 n_joints,)
        Inverse variances of a sample in the half-sums and half-differences of each axis.
    effect : ndarray, shape (n, 2 n_joints)
        Contributions to the unknowns by the torque of each axis, then by its known rotor
        (negative).
    """

    fit: Fit
    excitation: Excitation
    weights: Array
    effect: Array

    def residual_row(self, axis: int) -> Array:
        """Return the coefficients of torque and known columns in the residual of an axis."""
        return np.concatenate([[1.0], -self.fit.x[self.fit.layout.place(axis)]])

    def eliminate_levels(self, halves: Halves) -> Array:
        """Return the combinations of a recording's columns without levels of friction."""
        n = len(self.residual_row(halves.axis))
        return halves.eliminate_levels(self.weights[channels(halves)], n)


def solve(robot: Robot, recordings: Sequence[Halves], covariance: Covariance) -> Solution:
    """Solve for the unknowns excited by the recordings."""
    by_pair = numbered_pairs(recordings)
    together = np.zeros_like(by_pair)

    def excited(weights: Array, square: float = np.inf) -> Excitation:
        alone = blocks(robot, recordings, weights, together, alone=True).normal(weights)
        return excitation(alone.information, len(base_parameters(robot)), square)

    # kept unknowns and eliminated levels depend on the weights, and the weights on the residuals
    def weigh(weights: Array) -> Array:
        total = blocks(robot, recordings, weights, together)
        return Regression.weighed(total, excited(weights).unknowns, weights, rounds=1).weights

    weights = reweighted(weigh, np.ones(2 * robot.n_joints), ROUNDS)
    pairs = blocks(robot, recordings, weights, by_pair)
    # model errors repeat with the strokes and do not scatter over pairs, but over cells of states
    states = np.vstack([np.column_stack([each.q, each.speed]) for each in recordings])
    cells = blocks(robot, recordings, weights, cells_of(states))
    found = excited(weights, float(pairs.squares @ weights))
    regression = Regression(pairs, weights, found.unknowns)
    fit = regression.fit(covariance, cells, BLOCKS)
    effects = [regression.moved(pairs.recast(torque)) for torque in drive_torques(pairs)]
    return Solution(fit, found, weights, np.hstack(effects))


def blocks(
    robot: Robot,
    recordings: Sequence[Halves],
    weights: Array,
    groups: Indices,
    *,
    alone: bool = False,
) -> Blocks:
    """Condense half-sums and half-differences of recordings without levels of friction.

    Parameters
    ----------
    weights : ndarray, shape (2 n_joints,)
        Weights of the channels.
    groups : ndarray of int
        Group of each row, recording after recording.
    alone : bool
        Use the columns with all other axes at rest.
    """
    columns, axes = known(robot), axis_names(robot.n_joints)
    n = 1 + len(columns)
    products = np.zeros((int(groups.max()) + 1, 2 * robot.n_joints, n, n))
    counts = np.zeros(products.shape[:2])
    ends = np.cumsum([len(each.q) for each in recordings])[:-1]
    for each, own in zip(recordings, np.split(groups, ends), strict=True):
        at = channels(each)
        T = each.eliminate_levels(weights[at], n, alone=alone)
        rows = (each.alone if alone else each.rows) @ T
        for group in np.unique(own):
            part = rows[:, own == group]
            products[group, at] += np.swapaxes(part, 1, 2) @ part
            counts[group, at] += part.shape[1]
    names = {f"{axis} {half}": axis for axis in axes for half in ("sums", "differences")}
    shared = columns[: -len(COMMON)]
    return Blocks(shared, COMMON, products, counts, tuple(names), owners=names)


def channels(halves: Halves) -> slice:
    """Return the channels of a recording's half-sums and half-differences."""
    return slice(2 * halves.axis, 2 * halves.axis + 2)
