"""Least squares over all measurements within a subspace of the base parameters, with p-values.

Standard errors come from leaving out one measurement at a time (the delete-one jackknife of
`hil.estimation.identify`). How few measurements carry a coefficient decides what its ratio to
its standard error is worth: Student's t with

    (sum v)^2 / sum v^2

degrees of freedom, less one, v being each measurement's share of the coefficient's variance were
the noise white (Satterthwaite's approximation from the design, as in Bell and McCaffrey, Survey
Methodology 28 (2002) 169-181). Shares taken from the residuals instead are as uncertain as the
evidence itself: with them a ratio of 14 came out as chance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from hil.regression.least_squares import solved

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.simultaneous import SimultaneousFit

    Array = NDArray[np.float64]


class SubspaceFit:
    """Condensed measurements, to be solved within one subspace after the other.

    The common terms are eliminated once and for all: with N_pc and N_cc their blocks of the normal
    equations and B = N_pc inv(N_cc), what is left is ``(N_pp - B N_cp) p = v_p - B v_c``, and the
    same combination of a measurement's share is its score.
    """

    def __init__(self, joint: SimultaneousFit, n_all: int) -> None:
        N = np.sum([share for share, _ in joint.shares], axis=0)
        v = np.sum([side for _, side in joint.shares], axis=0)
        p, c = slice(None, n_all), slice(n_all, None)
        B = solved(N[c, c], N[c, p]).T
        back = solved(N[c, c], v[c])
        eliminated = np.column_stack([np.eye(n_all), -B])
        self._information = N[p, p] - B @ N[c, p]
        self._vector = v[p] - B @ v[c]
        rows = [(eliminated @ share, eliminated @ side) for share, side in joint.shares]
        self._shares = np.array([row @ eliminated.T for row, _ in rows])
        self._sides = np.array([side - row[:, c] @ back for row, side in rows])

    def beside(self, basis: Array, directions: Array) -> tuple[Array, Array]:
        """Information on `directions` less what `basis` can imitate, (k, k); and all of it."""
        N = self._information
        cross = basis.T @ N @ directions
        whole = directions.T @ N @ directions
        return whole - cross.T @ solved(basis.T @ N @ basis, cross), whole

    def solve(self, basis: Array) -> tuple[Array, Array, Array]:
        """Coefficients of `basis`, standard errors and p-values, shape (k,) each."""
        N = basis.T @ self._information @ basis
        shares = basis.T @ self._shares @ basis
        theta = solved(N, basis.T @ self._vector)
        scores = (self._sides - self._shares @ (basis @ theta)) @ basis
        change = np.array([solved(N - S, score) for S, score in zip(shares, scores, strict=True)])
        n = len(scores)
        error = np.sqrt((n - 1) / n * (change**2).sum(axis=0))
        inverse = solved(N, np.eye(len(N)))
        white = np.einsum("ij,njk,ki->ni", inverse, shares, inverse)
        degrees = np.clip(white.sum(axis=0) ** 2 / (white**2).sum(axis=0) - 1, 1, n - 1)
        p_value = 2 * stats.t.sf(np.abs(theta) / error, degrees)
        return theta, error, np.asarray(p_value)
