"""Weights and solvers of the overdetermined system W p = Q, eq. (11), from its inner products.

Weights are one for each axis:

uniform
    eq. (12), all axes alike;
torque
    the reciprocal of the axis's largest torque, squared (Seeger 1992);
prior
    the reciprocal of the mean square torque of the axis along the measured motion, predicted by
    expected parameters, by default those of a uniform fit (after Gautier and Khalil 1992);
residual
    the reciprocal of the axis's residual variance, by iteratively reweighted least squares (IRLS).

Solvers, each over weighted rows: least squares; instrumental variables, Z'W p = Z'Q with the
commanded motion's regressor Z (Seeger 1992); total least squares, the right singular vector to the
smallest singular value of [W Q], columns scaled to unit length (Gautier et al. 1994).

The covariance is estimated from the scores of the periods (Huber's sandwich): noise within a period
may be coloured, but errors correlated over several periods are not included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.least_squares.blocks import Blocks
from hil.least_squares.normal_equations import reweighted
from hil.least_squares.uncertainty import sandwich, scatter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.least_squares.normal_equations import Normal

    from .products import Products

    Array = NDArray[np.float64]

Weighting = Literal["uniform", "torque", "prior", "residual"]
Solver = Literal["least squares", "instrumental", "total"]


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Base parameters, then each axis's friction coefficients.

    Attributes
    ----------
    x : ndarray, shape (n_base + n_joints n_friction,)
    covariance : ndarray, shape (n, n)
    residual : ndarray, shape (n_joints,)
        Root mean square of each axis's residual [N m].
    condition : float
        Condition number of the weighted observation matrix.
    n_blocks : int
        Number of periods.
    """

    x: Array
    covariance: Array
    residual: Array
    condition: float
    n_blocks: int


def solve(
    data: Products,
    torque_limit: Array,
    weighting: Weighting,
    solver: Solver,
    expected: Array | None = None,
) -> Solution:
    """Solve for base parameters and friction.

    Parameters
    ----------
    data : Products
    torque_limit : ndarray, shape (n_joints,)
        Torque limits [N m].
    weighting, solver : str
        See the module.
    expected : ndarray, shape (n_base,), optional
        Expected parameters for the weighting "prior".
    """
    plain, weights = data.plain, _weights(data, torque_limit, weighting, expected)
    rows = data.crossed if solver == "instrumental" else plain
    total = _whole(rows, data, weights)
    x = solved_square(total.information, total.vector)
    if solver == "total":
        x = total_least_squares(total.information, total.vector, float(total.square[0]))
    scores = _blocks(rows, data).normal(weights).scores(x)
    inverse = solved_square(total.information, np.eye(len(x)))
    normal_matrix = _whole(plain, data, weights).information
    return Solution(
        x=x,
        covariance=sandwich(inverse, scatter(scores, few=True)),
        residual=np.sqrt(_squares_left(data, x)),
        condition=float(np.sqrt(np.linalg.cond(normal_matrix))),
        n_blocks=len(plain),
    )


def _blocks(products: Array, data: Products) -> Blocks:
    """Return periods with the common columns of base parameters, and those of friction."""
    n_own = products.shape[-1] - 1 - data.n_base
    base, own = (
        tuple(f"{name} {k}" for k in range(n)) for name, n in (("p", data.n_base), ("f", n_own))
    )
    return Blocks(base, own, products, data.counts)


def _whole(products: Array, data: Products, weights: Array) -> Normal:
    """Return the equations of all periods together."""
    return _blocks(products, data).total.normal(weights)


def _squares_left(data: Products, x: Array) -> Array:
    """Return the mean square residual of each axis."""
    return _blocks(data.plain, data).mean_squares(x)


def _weights(
    data: Products, torque_limit: Array, weighting: Weighting, expected: Array | None
) -> Array:
    if weighting == "uniform":
        return np.ones(len(torque_limit))
    of_torque, plain = 1.0 / torque_limit**2, data.plain

    def solution(weights: Array) -> Array:
        total = _whole(plain, data, weights)
        return solved_square(total.information, total.vector)

    def residual_weights(weights: Array) -> Array:
        return np.asarray(1.0 / np.maximum(_squares_left(data, solution(weights)), 1e-12))

    if weighting == "torque":
        return np.asarray(of_torque)
    if weighting == "prior":
        p = solution(np.ones(len(torque_limit)))[: data.n_base] if expected is None else expected
        base = slice(1, 1 + data.n_base)
        squares = np.einsum("i,aij,j->a", p, plain.sum(axis=0)[:, base, base], p)
        return np.asarray(np.maximum(data.counts.sum(axis=0), 1.0) / squares)
    return reweighted(residual_weights, of_torque)


def solved_square(M: Array, side: Array) -> Array:
    """Solve ``M x = side`` for a regular matrix, such as Z'W of instrumental variables.

    Parameters
    ----------
    M : ndarray, shape (n, n)
        Not necessarily symmetric; its diagonal is not zero.
    side : ndarray, shape (n,) or (n, k)

    Raises
    ------
    numpy.linalg.LinAlgError
        M is singular.
    """
    scale = 1.0 / np.sqrt(np.abs(np.diag(M)))
    solution: Array = (np.linalg.solve(M * np.outer(scale, scale), (side.T * scale).T).T * scale).T
    return solution


def total_least_squares(N: Array, v: Array, square: float) -> Array:
    """Solve ``W x = y`` by total least squares, with columns scaled to unit length.

    The right singular vector to the smallest singular value of [W y], eq. (2.7) of Van Huffel and
    Vandewalle, *The Total Least Squares Problem*, 1991.

    Parameters
    ----------
    N : ndarray, shape (n, n)
        W'W; no column of W is zero.
    v : ndarray, shape (n,)
        W'y.
    square : float
        y'y.
    """
    gram = np.block([[N, v[:, np.newaxis]], [v[np.newaxis], np.array([[square]])]])
    scale = 1.0 / np.sqrt(np.diag(gram))
    smallest = np.linalg.eigh(gram * np.outer(scale, scale)).eigenvectors[:, 0] * scale
    solution: Array = -smallest[:-1] / smallest[-1]
    return solution
