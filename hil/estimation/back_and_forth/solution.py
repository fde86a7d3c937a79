"""Fit base parameters to the half-sums and half-differences of all pairs (step 2).

Half-sums and half-differences of an axis are two channels of one regression with common unknowns:
friction not represented by a function of the speed, such as load-dependent friction, affects the
half-differences alone. Rows are weighted by the number of samples, channels by the residual
variance. Levels of friction of each recording are eliminated with these weights.

Friction fluctuations and noise differ from one pair of strokes to the next: pairs are groups. Model
errors repeat with the strokes, but differ between regions of the state space: scatter over
cells of states counts, too (`hil.least_squares.regression`).

An axis moving alone shows the diagonal of the mass matrix, and gravity, but no couplings. Motion in
few configurations shows only sums of parameters. Linearly dependent columns of the regression are
found by Cholesky factorisation with pivoting of the scaled normal equations (Gautier, J. Robotic
Syst. 8 (1991) 485-506, does the same by the QR decomposition). Of a dependent set some parameters
are kept, and each represents itself and a share of the dropped ones:

    W_d = W_k B   so   W_k p_k + W_d p_d = W_k (p_k + B p_d).

Each step keeps the parameter with the longest remaining column, p35 in the sum p30 + 1.8e7 p35. If
p35 must be dropped for another reason, p30 is dropped too, since p30 would represent 1.8e7 p35: a
kept parameter represents at most `LARGEST` times another one.

A nearly dependent column is dropped too if noise alone would make the torque of its parameter, over
the recorded motion, uncertain by more than the share `LOOSE` of the torque: for rows of unit
residual variance and a column with the share r of its square length left, the sum of squares of
that torque is uncertain by 1 / r.

Dropped parameters are zero in the model: the model predicts only quantities excited by such
motions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.back_and_forth.halves import COMMON, known, numbered_pairs
from hil.estimation.condensed import drive_torques
from hil.estimation.free_motion.accumulation import cells_of
from hil.estimation.free_motion.result import LOOSE
from hil.least_squares.blocks import Blocks
from hil.least_squares.layout import axis_names
from hil.least_squares.normal_equations import reweighted
from hil.least_squares.regression import ROUNDS, Regression
from hil.least_squares.solving import IDENTIFIABLE, SILENT, solved
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.back_and_forth.halves import Halves
    from hil.least_squares.regression import Covariance, Fit
    from hil.model.robot import Robot


LARGEST = 10.0
"""Largest coefficient of another parameter in the sum that a kept parameter represents. Longer
columns come first, so useful sums have coefficients up to about 1. On the UR10e the coefficients
are up to 2, but 1e5 or zero where axes are at right angles.
"""
NOTICEABLE = 1e-3
"""Smallest share of a parameter in a combination, below the displayed precision."""


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """Excited parameters and combinations.

    Attributes
    ----------
    kept : ndarray of int
        Identified parameters, alone or in combination.
    nuisance : ndarray of int
        Linearly independent nuisance unknowns, as indices into all unknowns.
    combination : ndarray, shape (n, n)
        ``combination @ p`` is the identified part of parameters p; rows of dropped parameters are
        zero.
    """

    kept: Indices
    nuisance: Indices
    combination: Array

    @property
    def unknowns(self) -> Indices:
        """Identified unknowns: parameters, then nuisances."""
        return np.concatenate([self.kept, self.nuisance])

    @property
    def lost(self) -> Indices:
        """Dropped parameters."""
        return np.setdiff1d(np.arange(len(self.combination)), self.kept)


def excitation(N: Array, n: int, square: float) -> Excitation:
    """Determine the excited parameters among the first `n` unknowns; the rest are nuisances.

    Parameters
    ----------
    N : ndarray, shape (n + k, n + k)
        Normal equations of rows with unit residual variance.
    square : float
        Sum of squared torques of these rows.
    """
    size = np.diag(N)
    nuisance = n + independent(N[n:, n:], size[n:])
    within = N[:n, nuisance] @ solved(N[np.ix_(nuisance, nuisance)], N[nuisance, :n])
    left = N[:n, :n] - within
    kept = independent(left, size[:n], max(IDENTIFIABLE, 1.0 / (LOOSE**2 * square)), LARGEST)
    lost = np.setdiff1d(np.arange(n), kept)
    combination = np.zeros((n, n))
    combination[kept, kept] = 1.0
    shares = solved(left[np.ix_(kept, kept)], left[np.ix_(kept, lost)])
    length = np.sqrt(size)
    # a parameter without any effect on the torque is in no combination
    parts = np.abs(shares) * length[kept, np.newaxis] > NOTICEABLE * length[lost]
    parts &= length[lost] > SILENT * length.max(initial=0.0)
    combination[np.ix_(kept, lost)] = np.where(parts, shares, 0.0)
    return Excitation(kept, nuisance, combination)


def independent(
    N: Array, size: Array, least: float = IDENTIFIABLE, largest: float = np.inf
) -> Indices:
    """Return the unknowns with linearly independent columns, in rising order.

    Parameters
    ----------
    N : ndarray, shape (n, n)
    size : ndarray, shape (n,)
        Squared lengths of the columns, the reference for the independent parts.
    least : float
        Smallest independent share of the squared length of a kept column.
    largest : float
        Largest coefficient of another unknown in a combination.
    """
    heard = size > SILENT**2 * size.max(initial=0.0)
    scale = np.where(heard, 1.0, 0.0) / np.sqrt(np.where(heard, size, 1.0))
    left, kept = N * np.outer(scale, scale), []
    length, open_ = np.sqrt(size) * heard, heard.copy()
    for _ in range(len(N)):
        share = np.where(open_, np.diag(left), 0.0)
        pivot = int(np.argmax(np.where(share > least, share * size, 0.0)))
        if share[pivot] <= least:
            break
        open_[pivot] = False
        coefficients = left[:, pivot] / left[pivot, pivot] * length / length[pivot]
        if np.abs(coefficients).max() > largest:
            continue
        kept.append(pivot)
        column = left[:, pivot] / np.sqrt(left[pivot, pivot])
        left = left - np.outer(column, column)
        left[pivot], left[:, pivot] = 0.0, 0.0
    return np.array(sorted(kept), dtype=np.intp)


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
