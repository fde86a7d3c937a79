"""Weights and solvers of the overdetermined system W p = Q, eq. (11), from its inner products.

Weights are one for each axis:

uniform
    eq. (12) as it stands;
torque
    the reciprocal of the axis's largest torque, squared (Seeger 1992);
prior
    the reciprocal of the mean square torque that expected parameters predict for the axis along the
    measured motion (after Gautier and Khalil 1992); expected are a uniform fit's where none given;
residual
    the reciprocal of the axis's residual variance, found by solving again and again (IRLS).

Solvers, each over weighted rows: least squares; instrumental variables, Z'W p = Z'Q with the
commanded motion's regressor Z (Seeger 1992); total least squares, the right singular vector to the
smallest singular value of [W Q], columns scaled to unit length (Gautier et al. 1994).

The covariance is that of the scores of periods (Huber's sandwich): noise within a period may be
coloured, what lasts over periods shows in none of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.regression.least_squares import solved_square, total_least_squares
from hil.regression.uncertainty import sandwich, scatter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.conventional.products import Products

    Array = NDArray[np.float64]

Weighting = Literal["uniform", "torque", "prior", "residual"]
Solver = Literal["least squares", "instrumental", "total"]
ROUNDS = 20
"""Times that residual variances and solution are found from each other, at most."""


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
        Of the weighted observation matrix.
    n_blocks : int
        Periods behind it.
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
        [N m].
    weighting, solver : str
        See the module.
    expected : ndarray, shape (n_base,), optional
        Of the "prior" weighting.
    """
    sums = data.blocks.sum(axis=0)
    system = _System(data)
    weights = _weights(data, system, sums, torque_limit, weighting, expected)
    square = system.matrix(sums, weights, instrumental=solver == "instrumental")
    right = system.vector(sums, weights, instrumental=solver == "instrumental")
    x = solved_square(square, right)
    if solver == "total":
        x = total_least_squares(square, right, float(weights @ sums[:, 0, 0]))
    normal = system.matrix(sums, weights)
    return Solution(
        x=x,
        covariance=_sandwich(
            data, system, weights, square, x, instrumental=solver == "instrumental"
        ),
        residual=np.sqrt(system.variances(sums, data.counts.sum(axis=0), x)),
        condition=float(np.sqrt(np.linalg.cond(normal))),
        n_blocks=len(data.blocks),
    )


class _System:
    """Where columns of one axis stand among all unknowns."""

    def __init__(self, data: Products) -> None:
        self._n_joints = data.blocks.shape[1]
        self.n_base, k = data.n_base, data.n_friction
        self.n = self.n_base + self._n_joints * k
        self._width = self.n_base + k
        base = np.arange(self.n_base)
        self.places = [
            np.concatenate([base, self.n_base + axis * k + np.arange(k)])
            for axis in range(self._n_joints)
        ]

    def matrix(self, sums: Array, weights: Array, *, instrumental: bool = False) -> Array:
        """W'W, or Z'W, over all unknowns."""
        first = 1 + (self._width if instrumental else 0)
        total = np.zeros((self.n, self.n))
        for place, product, weight in zip(self.places, sums, weights, strict=True):
            part = product[first : first + self._width, 1 : 1 + self._width]
            total[np.ix_(place, place)] += weight * part
        return total

    def vector(self, sums: Array, weights: Array, *, instrumental: bool = False) -> Array:
        """W'Q, or Z'Q, over all unknowns."""
        first = 1 + (self._width if instrumental else 0)
        total = np.zeros(self.n)
        for place, product, weight in zip(self.places, sums, weights, strict=True):
            total[place] += weight * product[first : first + self._width, 0]
        return total

    def variances(self, sums: Array, counts: Array, x: Array) -> Array:
        """Mean square residual of each axis."""
        found = np.zeros(self._n_joints)
        for axis, (place, product) in enumerate(zip(self.places, sums, strict=True)):
            around = np.concatenate([[1.0], -x[place]])
            head = product[: 1 + self._width, : 1 + self._width]
            found[axis] = max(float(around @ head @ around), 0.0) / max(counts[axis], 1.0)
        return found


def _weights(
    data: Products,
    system: _System,
    sums: Array,
    torque_limit: Array,
    weighting: Weighting,
    expected: Array | None,
) -> Array:
    counts = data.counts.sum(axis=0)
    uniform = np.ones(len(torque_limit))
    if weighting == "uniform":
        return uniform
    weights = 1.0 / torque_limit**2
    if weighting == "torque":
        return weights
    if weighting == "prior":
        p = expected
        if p is None:
            x = solved_square(system.matrix(sums, uniform), system.vector(sums, uniform))
            p = x[: system.n_base]
        inner = sums[:, 1 : 1 + system.n_base, 1 : 1 + system.n_base]
        return np.asarray(np.maximum(counts, 1.0) / np.einsum("i,aij,j->a", p, inner, p))
    for _ in range(ROUNDS):
        before = weights
        x = solved_square(system.matrix(sums, weights), system.vector(sums, weights))
        weights = 1.0 / np.maximum(system.variances(sums, counts, x), 1e-12)
        if np.allclose(before, weights, rtol=1e-6):
            break
    return weights


def _sandwich(
    data: Products,
    system: _System,
    weights: Array,
    square: Array,
    x: Array,
    *,
    instrumental: bool,
) -> Array:
    scores = np.array(
        [
            system.vector(block, weights, instrumental=instrumental)
            - system.matrix(block, weights, instrumental=instrumental) @ x
            for block in data.blocks
        ]
    )
    return sandwich(solved_square(square, np.eye(system.n)), scatter(scores, few=True))
