"""A load at the last link from two runs of free motions, without and with it; gains by its mass.

Base parameters, load and, where the mass is stated, the gains of all axes are found from both runs
at once (`two_runs`). Their uncertainty comes, as for any free motions, from what differs from one
block of time to the next, and from one part of the space of states to the next. Noise is in both,
so that their sum would count it twice: the larger of the two variances counts.

Whether anything but a rigid load changed is tested with a change dp of all base parameters in its
place: what of dp no load explains should be no larger than its covariance (Hotelling's T^2). In the
same way a load that is nothing but error is found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import linalg, special

from hil.estimation.free_motion.solution import BLOCKS
from hil.estimation.free_motion.two_runs import LoadTerms, State, TwoRuns
from hil.estimation.intervals import MANY
from hil.estimation.load_columns import load_columns, without_mass
from hil.estimation.payload_figures import MASS
from hil.least_squares.regression import by_groups_and_cells
from hil.least_squares.solving import IDENTIFIABLE, inverse, undetermined
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.free_motion.gathering import Gathered
    from hil.least_squares.regression import Uncertainty
    from hil.model.robot import Robot


class Chance(NamedTuple):
    """Hotelling's T^2 of so many directions, and the chance of one at least as great."""

    square: float
    directions: int
    p_value: float


@dataclass(frozen=True, slots=True, eq=False)
class LoadFit:
    """What two runs give of a load.

    Attributes
    ----------
    phi : ndarray, shape (10,)
        Standard parameters in the last link's frame, order of eq. (4).
    covariance : ndarray, shape (10, 10)
        Zero for those that were stated, that the robot file leaves out or that are lost.
    degrees : ndarray, shape (10,)
        Effective degrees of freedom.
    lost : ndarray of bool, shape (10,)
        Parameters that these motions do not determine.
    gains : ndarray, shape (n_joints,)
        [N m or N for one unit of the signal].
    gain_errors : ndarray, shape (n_joints,)
        Relative standard errors; 0 for gains that were taken as stated, inf for those that the load
        does not determine, which are as they were.
    present : Chance
        Of no load at all.
    rigid : Chance
        Of nothing but a rigid load.
    """

    phi: Array
    covariance: Array
    degrees: Array
    lost: Mask
    gains: Array
    gain_errors: Array
    present: Chance
    rigid: Chance


def fit_load(
    robot: Robot, runs: Sequence[Gathered], mass: float | None = None, *, gains: bool = False
) -> LoadFit:
    """Find a load.

    Parameters
    ----------
    runs : sequence of Gathered
        Without and with it.
    mass : float, optional
        Of the load, if it is known: held [kg].
    gains : bool
        Whether the gains of all axes are found too, which takes the mass.

    Raises
    ------
    NoLoad
        The robot file states no parameter of the last link that a load could change.
    """
    K, free = load_columns(robot)
    known = np.zeros(10)
    if mass is not None:
        known[MASS], free = mass, without_mass(free)
    terms = LoadTerms(K @ known, K @ free)
    found = np.unique([axis for run in runs for axis in run.scaling.unknown]).astype(int)
    axes = tuple(range(robot.n_joints)) if gains else tuple(found.tolist())
    two, state, lost = _determined(runs, terms, axes, _beginning(robot, runs, mass, gains=gains))
    pieces, cells = two.pieces(terms, state), two.cells(terms, state)
    place = slice(two.n_base, two.n_base + free.shape[1])
    spread = by_groups_and_cells(pieces.grouped(BLOCKS), cells, state.x)
    V = _larger(spread) + _of_stated_gains(robot, two, terms, state)
    lost_phi = np.abs(free[:, lost[: free.shape[1]]]).max(axis=1, initial=0.0) > 0
    covariance = free @ V[place, place] @ free.T
    covariance[lost_phi], covariance[:, lost_phi] = 0.0, 0.0
    shown = np.zeros(robot.n_joints)
    shown[list(axes)] = np.inf
    changes = slice(place.stop, place.stop + len(two.axes))
    shown[list(two.axes)] = np.sqrt(np.diag(V)[changes])
    groups = 2 * BLOCKS + int((cells.square > 0).sum())
    return LoadFit(
        phi=known + np.where(lost_phi, 0.0, free @ state.x[place]),
        covariance=covariance,
        degrees=np.where(free.any(axis=1), np.abs(free) @ spread.degrees_of_freedom[place], MANY),
        lost=lost_phi,
        gains=state.gains,
        gain_errors=shown,
        present=_test(state.x[place], V[place, place], groups),
        rigid=_rigid(robot, runs, terms, state, groups),
    )


def _beginning(robot: Robot, runs: Sequence[Gathered], mass: float | None, *, gains: bool) -> Array:
    """Gains to begin with; where one was held at random, scaled so that the mass is right."""
    start: Array = np.exp(np.mean([np.log(run.scaling.gains) for run in runs], axis=0))
    if mass is None or not gains or not runs[0].found.unknown_gains:
        return start
    K, free = load_columns(robot)
    terms = LoadTerms(np.zeros(len(K)), K @ free)
    state = TwoRuns(runs, len(K), ()).solved(terms, start)
    found = float((free @ state.x[len(K) : len(K) + free.shape[1]])[MASS])
    return start * (mass / found if found > 0 else 1.0)


def _determined(
    runs: Sequence[Gathered], terms: LoadTerms, axes: tuple[int, ...], start: Array
) -> tuple[TwoRuns, State, Mask]:
    """Equations and solution with the gains that are determined, and what of the load is not."""
    n, k = terms.columns.shape
    two = TwoRuns(runs, n, axes)
    state = two.solved(terms, start)
    lost = undetermined(two.pieces(terms, state).information, IDENTIFIABLE)
    kept = tuple(a for a, each in zip(axes, lost[n + k :], strict=False) if not each)
    if kept != axes:
        two = TwoRuns(runs, n, kept)
        state = two.solved(terms, start)
        lost = undetermined(two.pieces(terms, state).information, IDENTIFIABLE)
    return two, state, lost[n : n + k]


def _of_stated_gains(robot: Robot, two: TwoRuns, terms: LoadTerms, state: State) -> Array:
    """Covariance from gains that are taken as stated, as uncertain as the map says."""
    shares = robot.torque_constant_uncertainty.copy()
    shares[list(two.axes)] = 0.0
    effect = two.effect(terms, state, shares)
    covariance: Array = effect @ effect.T
    return covariance


def _rigid(
    robot: Robot, runs: Sequence[Gathered], terms: LoadTerms, state: State, groups: int
) -> Chance:
    """Test a change of all base parameters against those that a load makes."""
    n = len(base_parameters(robot))
    any_change = LoadTerms(terms.known, np.eye(n))
    two = TwoRuns(runs, n, ())
    free = two.solved(any_change, state.gains)
    pieces, cells = two.pieces(any_change, free), two.cells(any_change, free)
    V = _larger(by_groups_and_cells(pieces.grouped(BLOCKS), cells, free.x))[n : 2 * n, n : 2 * n]
    other = linalg.null_space(terms.columns.T)
    return _test(other.T @ free.x[n : 2 * n], other.T @ V @ other, groups)


def _larger(spread: Uncertainty) -> Array:
    """Covariance with the larger variances, and the correlations of the sum."""
    sums = np.diag(spread.covariance)
    of_states = np.diag(spread.of_cells)
    largest = np.maximum(of_states, sums - of_states)
    share = np.sqrt(np.divide(largest, sums, out=np.zeros_like(sums), where=sums > 0))
    covariance: Array = spread.covariance * np.outer(share, share)
    return covariance


def _test(x: Array, V: Array, groups: int) -> Chance:
    """Test x = 0, its covariance V being found from so many groups of samples."""
    k = len(x)
    if not k:
        return Chance(0.0, 0, 1.0)
    square = float(x @ inverse(V) @ x)
    rest = max(groups - k, 1)
    p_value = float(special.fdtrc(k, rest, square * rest / (k * max(groups - 1, 1))))
    return Chance(square, k, p_value)
