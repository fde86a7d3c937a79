"""Least squares under linear matrix inequalities, solved by Clarabel.

    minimise  |A u - b|^2  with  C_i + sum_k u_k F_ik >= 0,

a convex program whose solution is found to rounding by an interior-point method (Goulart and Chen,
Clarabel, 2024). A symmetric matrix enters as the vector of its upper triangle, column by column,
elements beside the diagonal times the root of 2, which keeps inner products.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hil.errors import NotRealisable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array


TOLERANCES = 1e-10, 1e-8
"""Of residuals and gap, relative; the second where the first is not reached."""
_NOISE = 1e-12


class Inequality(NamedTuple):
    """``constant + weights @ u >= 0``: shapes (size, size) and (size, size, n)."""

    constant: Array
    weights: Array


class Solved(NamedTuple):
    """Solution u of shape (n,), and of each inequality its multiplier, shape (size, size)."""

    u: Array
    multipliers: list[Array]


def least_squares(A: Array, b: Array, inequalities: Sequence[Inequality]) -> Solved:
    """Solve the program of the module.

    It is solved in two units of u, its own and that in which the inequalities' columns have length
    1, and the better solution is taken: which one converges further depends on how far the
    solution lies from u = 0.

    Raises
    ------
    NotRealisable
        No solution meets all inequalities, or none was found.
    """
    rows = np.vstack([_as_vectors(each.weights) for each in inequalities])
    lengths = np.maximum(np.linalg.norm(rows, axis=0), _NOISE)
    units = np.ones(len(lengths)), 1.0 / lengths, 1.0 / np.sqrt(lengths)
    for tried, tolerance in product((units[:2], units[2:]), TOLERANCES):
        found = [_solved(A, b, inequalities, unit, tolerance) for unit in tried]
        usable = [each for each in found if each is not None]
        if usable:
            return min(usable, key=lambda each: float(np.sum((A @ each.u - b) ** 2)))
    raise NotRealisable(
        "no bodies meet all conditions: widen the bounds of masses and centres of mass"
    )


def _solved(
    A: Array, b: Array, inequalities: Sequence[Inequality], unit: Array, tolerance: float
) -> Solved | None:
    """Solution in given units of u, or None where the solver finds none that holds."""
    import clarabel  # noqa: PLC0415 - needed for this alone
    from scipy import sparse  # noqa: PLC0415 - as above

    sizes = [len(each.constant) for each in inequalities]
    weights = [each.weights * unit for each in inequalities]
    square, slope = _scaled(A * unit, b)
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(square)),
        -slope,
        sparse.csc_matrix(_without_noise(-np.vstack([_as_vectors(each) for each in weights]))),
        _without_noise(np.concatenate([_as_vectors(each.constant) for each in inequalities])),
        [clarabel.PSDTriangleConeT(n) for n in sizes],
        _settings(clarabel, tolerance),
    ).solve()
    u = unit * np.array(solution.x)
    if str(solution.status) not in {"Solved", "AlmostSolved"} or not _hold(inequalities, u):
        return None
    ends = np.cumsum([n * (n + 1) // 2 for n in sizes])[:-1]
    parts = np.split(np.array(solution.z), ends)
    return Solved(u, [_as_matrix(z, n) for z, n in zip(parts, sizes, strict=True)])


def _hold(inequalities: Sequence[Inequality], u: Array) -> bool:
    """Whether all inequalities hold to the solver's precision."""
    matrices = [each.constant + each.weights @ u for each in inequalities]
    # share by which an inequality may fail, over its greatest element
    return all(
        np.linalg.eigvalsh(each)[0] > -1e-7 * max(1.0, float(np.abs(each).max()))
        for each in matrices
    )


def _settings(clarabel: Any, tolerance: float) -> Any:
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    settings.chordal_decomposition_enable = False  # matrices are small and full
    return settings


def _scaled(A: Array, b: Array) -> tuple[Array, Array]:
    """Matrix and slope of the objective, in units in which the greatest element is 1."""
    square = A.T @ A
    greatest = float(np.abs(square).max())
    return _without_noise(square / greatest), A.T @ b / greatest


def _without_noise(x: Array) -> Array:
    """Exact zeros where rounding has left something: the solver's factors are sparse."""
    return np.where(np.abs(x) < _NOISE * np.abs(x).max(initial=0.0), 0.0, x)


def _as_vectors(matrices: Array) -> Array:
    """Upper triangles of matrices, shape (size, size, ...) to (size (size + 1) / 2, ...)."""
    column, row = np.tril_indices(len(matrices))
    scale = np.where(row == column, 1.0, np.sqrt(2.0))
    return np.asarray((matrices[row, column].T * scale).T)


def _as_matrix(vector: Array, size: int) -> Array:
    column, row = np.tril_indices(size)
    matrix = np.zeros((size, size))
    matrix[row, column] = vector / np.where(row == column, 1.0, np.sqrt(2.0))
    return np.asarray(matrix + np.triu(matrix, 1).T)
