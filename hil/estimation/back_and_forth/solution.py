"""Step 2: all half-sums and half-differences to one set of base parameters.

Rows are weighted by the number of their samples and by the residual variance of their axis, that of
half-sums and of half-differences apart: friction that is no function of the speed, such as one that
grows with the load, spoils the latter alone. Friction of each recording is eliminated by orthogonal
projection.

Standard errors are in `uncertainty`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.back_and_forth.excitation import Excitation, excitation, independent
from hil.estimation.back_and_forth.halves import COMMON, FIRST, MOTOR, TORQUE, unknown_places
from hil.estimation.back_and_forth.uncertainty import uncertainty
from hil.estimation.free_motion.accumulation import cells_of
from hil.estimation.intervals import MANY
from hil.least_squares.layout import embedded
from hil.least_squares.normal_equations import Normal, reweighted
from hil.least_squares.solving import condition, fitted, orthonormal, projected_out, solved
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.back_and_forth.halves import Halves
    from hil.model.robot import Robot

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]

ROUNDS = 6
"""Of weights from residuals and solution from weights."""
BLOCKS = 200
"""Of successive pairs, at most: what friction does lasts longer than a pair."""
_CONSTANT = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Weighted rows of all recordings, friction eliminated.

    Attributes
    ----------
    X, excited : ndarray, shape (n, n_unknowns)
        Columns, and those that they would be had all other axes stood still.
    torque, motor : ndarray, shape (n,)
    of_differences : ndarray of bool, shape (n,)
    axis, pair, state : ndarray, shape (n,), (n,), (n, n_joints + 1)
        Pairs are numbered over all recordings; a state is positions and speed.
    """

    X: Array
    excited: Array
    torque: Array
    motor: Array
    of_differences: NDArray[np.bool_]
    axis: Indices
    pair: Indices
    state: Array

    @property
    def y(self) -> Array:
        """Torque less the motors' known part."""
        return self.torque - self.motor

    def normal(self, group: Indices, kept: Indices) -> Normal:
        """Normal equations by groups of rows, numbered from 0."""
        n = int(group.max()) + 1
        N, v, square = np.zeros((n, len(kept), len(kept))), np.zeros((n, len(kept))), np.zeros(n)
        for each in range(n):
            X, y = self.X[group == each][:, kept], self.y[group == each]
            N[each], v[each], square[each] = X.T @ X, X.T @ y, y @ y
        return Normal(N, v, square)


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """What half-sums and half-differences say.

    Attributes
    ----------
    x : ndarray, shape (n_unknowns,)
        Base parameters, zero where they are not kept, and by axis what differs by direction.
    covariance : ndarray, shape (n_unknowns, n_unknowns)
    degrees_of_freedom : ndarray, shape (n_unknowns,)
    excitation : Excitation
    condition : float
        Of the weighted columns of what is kept, at unit length.
    of_torque, of_motor : ndarray, shape (n_unknowns, n_joints)
        The parts of `x` from the torque of each axis, and from its motors' known part.
    variances : ndarray, shape (n_joints, 2)
        Of residuals of half-sums and half-differences, for one sample [N^2 m^2 or N^2].
    """

    x: Array
    covariance: Array
    degrees_of_freedom: Array
    excitation: Excitation
    condition: float
    of_torque: Array
    of_motor: Array
    variances: Array


def solve(robot: Robot, recordings: Sequence[Halves]) -> Solution:
    """Solve for all unknowns that the recordings excite."""
    n_base, n = len(base_parameters(robot)), robot.n_joints

    def weigh(variances: Array) -> Array:
        rows = projected(robot, recordings, variances)
        return _variances(rows, _solved(rows, n_base, np.inf)[2], variances)

    variances = reweighted(weigh, _first_variances(recordings, n), ROUNDS, 1e-3)
    rows = projected(robot, recordings, variances)
    found, kept, x = _solved(rows, n_base, float(rows.y @ rows.y))
    return _solution(rows, x, kept, found, variances, n)


def _solved(rows: Rows, n_base: int, square: float) -> tuple[Excitation, Indices, Array]:
    """What is excited, which unknowns are kept, and their values among all."""
    N = rows.excited.T @ rows.excited
    found = excitation(N, n_base, square)
    nuisance = n_base + independent(N[n_base:, n_base:], np.diag(N)[n_base:])
    kept = np.concatenate([found.kept, nuisance])
    X = rows.X[:, kept]
    return found, kept, embedded(solved(X.T @ X, X.T @ rows.y), kept, len(N))


def projected(robot: Robot, recordings: Sequence[Halves], variances: Array) -> Rows:
    """Weighted rows of all recordings, the friction of each projected out."""
    n_unknowns = len(base_parameters(robot)) + COMMON * robot.n_joints
    parts, pairs = [], 0
    for each in recordings:
        places = unknown_places(robot, each.axis)
        last = FIRST + len(places)
        weights = [np.sqrt(each.weight / variance) for variance in variances[each.axis]]
        rows = np.vstack([weights[0][:, None] * each.sums, weights[1][:, None] * each.differences])
        excited = np.concatenate(weights)[:, None] * each.excited
        friction, _ = orthonormal(rows[:, last:])
        rows = np.hstack([rows[:, :last], excited])
        rows = projected_out(friction, rows)
        X, Z = np.zeros((2, len(rows), n_unknowns))
        X[:, places] = rows[:, FIRST:last]
        Z[:, places] = np.hstack([rows[:, last:], rows[:, last - COMMON : last]])
        number = np.unique(each.pair, return_inverse=True)[1]
        state = np.column_stack([each.q, each.speed])
        parts.append(Rows(
            X=X, excited=Z, torque=rows[:, TORQUE], motor=rows[:, MOTOR],
            of_differences=np.repeat([False, True], len(each.weight)),
            axis=np.full(len(rows), each.axis), pair=pairs + np.tile(number, 2),
            state=np.tile(state, (2, 1)),
        ))  # fmt: skip
        pairs += int(number.max()) + 1
    return Rows(*(np.concatenate([getattr(part, name) for part in parts])
                  for name in Rows.__slots__))  # fmt: skip


def friction_levels(robot: Robot, halves: Halves, solution: Solution) -> Array:
    """Coefficients of the columns of friction of one recording."""
    places = unknown_places(robot, halves.axis)
    around = np.concatenate([[1.0, -1.0], -solution.x[places]])
    last = len(around)
    deviations = np.sqrt(solution.variances[halves.axis])
    both = np.vstack([halves.sums / deviations[0], halves.differences / deviations[1]])
    both *= np.sqrt(np.tile(halves.weight, 2))[:, np.newaxis]
    return fitted(both[:, last:], both[:, :last] @ around)


def _first_variances(recordings: Sequence[Halves], n_joints: int) -> Array:
    found = np.ones((n_joints, 2))
    for axis in {each.axis for each in recordings}:
        torque = np.concatenate([e.sums[:, TORQUE] for e in recordings if e.axis == axis])
        found[axis] = max(float(np.var(torque)), 1e-300)
    return found


def _variances(rows: Rows, x: Array, before: Array) -> Array:
    """Variances of the residuals of a sample, by axis and half."""
    squares, found = (rows.y - rows.X @ x) ** 2, before.copy()
    for axis in np.unique(rows.axis):
        for half in (0, 1):
            own = (rows.axis == axis) & (rows.of_differences == bool(half))
            found[axis, half] *= float(squares[own].mean())
        found[axis] = np.maximum(found[axis], 1e-6 * found[axis].max() + 1e-300)
    return found


def _solution(
    rows: Rows, x: Array, kept: Indices, excited: Excitation, variances: Array, n_joints: int
) -> Solution:
    scatter = rows.state.std(axis=0)
    states = rows.state / np.where(scatter > _CONSTANT, scatter, 1.0)
    cells = np.unique(cells_of(states), return_inverse=True)[1]
    pairs = rows.normal(rows.pair, kept)
    covariance, degrees_kept = uncertainty(pairs.grouped(BLOCKS), rows.normal(cells, kept), x[kept])
    n = len(x)
    degrees = np.full(n, MANY)
    degrees[kept] = degrees_kept
    N = pairs.information
    parts = np.zeros((2, n, n_joints))
    for axis in range(n_joints):
        mine = rows.X[:, kept][rows.axis == axis].T
        for k, side in enumerate((rows.torque, rows.motor)):
            parts[k][kept, axis] = solved(N, mine @ side[rows.axis == axis])
    return Solution(
        x=x,
        covariance=embedded(covariance, kept, n),
        degrees_of_freedom=degrees,
        excitation=excited,
        condition=condition(N),
        of_torque=parts[0],
        of_motor=parts[1],
        variances=variances,
    )
