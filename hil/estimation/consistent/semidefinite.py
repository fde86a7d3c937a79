"""Least squares under linear matrix inequalities, solved by Clarabel.

    minimise  |A u - b|^2  with  C_i + sum_k u_k F_ik >= 0,

is a convex program, solved to rounding by an interior-point method (Goulart and Chen, Clarabel,
2024). A symmetric matrix enters as the vector of its upper triangle, column by column, with
off-diagonal elements times the root of 2, which keeps inner products.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import NotRealisable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array


TOLERANCES = 1e-10, 1e-8
"""Relative tolerances of residuals and gap; the second applies if the first is not reached."""
_NOISE = 1e-12


class Inequality(NamedTuple):
    """``constant + weights @ u >= 0``: shapes (size, size) and (size, size, n)."""

    constant: Array
    weights: Array


class Solved(NamedTuple):
    """Solution u, shape (n,), and multipliers of the inequalities, shape (size, size)."""

    u: Array
    multipliers: list[Array]


def least_squares(A: Array, b: Array, inequalities: Sequence[Inequality]) -> Solved:
    """Solve the least-squares program under linear matrix inequalities.

    The program is solved in two units of u, the original unit and the unit that gives the
    inequalities' columns length 1, and the better solution is taken: convergence depends on the
    distance of the solution from u = 0. If neither converges, their geometric mean is tried.

    Raises
    ------
    NotRealisable
        No solution meets all inequalities, or none was found.
    """
    rows = np.vstack([_vectorise(each.weights) for each in inequalities])
    lengths = np.maximum(np.linalg.norm(rows, axis=0), _NOISE)
    units = np.ones(len(lengths)), 1.0 / lengths, 1.0 / np.sqrt(lengths)
    for tried, tolerance in product((units[:2], units[2:]), TOLERANCES):
        found = [_solved(A, b, inequalities, unit, tolerance) for unit in tried]
        usable = [each for each in found if each is not None]
        if usable:
            return min(usable, key=lambda each: float(np.sum((A @ each.u - b) ** 2)))
    raise NotRealisable(
        "no physically consistent links meet all conditions: widen the bounds of masses and "
        "centres of mass"
    )


def _solved(
    A: Array, b: Array, inequalities: Sequence[Inequality], unit: Array, tolerance: float
) -> Solved | None:
    """Solve in given units of u; return None without a solution that meets all inequalities."""
    import clarabel  # noqa: PLC0415 - needed for this alone
    from scipy import sparse  # noqa: PLC0415 - as above

    sizes = [len(each.constant) for each in inequalities]
    weights = [each.weights * unit for each in inequalities]
    scaled = A * unit
    square = scaled.T @ scaled
    greatest = float(np.abs(square).max())
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    settings.chordal_decomposition_enable = False  # matrices are small and full
    solution = clarabel.DefaultSolver(
        # the objective is scaled to a greatest element of 1
        sparse.csc_matrix(np.triu(_drop_noise(square / greatest))),
        -(scaled.T @ b / greatest),
        sparse.csc_matrix(_drop_noise(-np.vstack([_vectorise(each) for each in weights]))),
        _drop_noise(np.concatenate([_vectorise(each.constant) for each in inequalities])),
        [clarabel.PSDTriangleConeT(n) for n in sizes],
        settings,
    ).solve()
    u = unit * np.array(solution.x)
    if str(solution.status) not in {"Solved", "AlmostSolved"} or not _hold(inequalities, u):
        return None
    ends = np.cumsum([n * (n + 1) // 2 for n in sizes])[:-1]
    parts = np.split(np.array(solution.z), ends)
    return Solved(u, [_unvectorise(z, n) for z, n in zip(parts, sizes, strict=True)])


def _hold(inequalities: Sequence[Inequality], u: Array) -> bool:
    """Return True if all inequalities are met within the precision of the solver."""
    matrices = [each.constant + each.weights @ u for each in inequalities]
    # admissible violation of an inequality, over its greatest element
    return all(
        np.linalg.eigvalsh(each)[0] > -1e-7 * max(1.0, float(np.abs(each).max()))
        for each in matrices
    )


def _drop_noise(x: Array) -> Array:
    """Set elements at the level of rounding to zero: the solver's factors are sparse."""
    return np.where(np.abs(x) < _NOISE * np.abs(x).max(initial=0.0), 0.0, x)


def _vectorise(matrices: Array) -> Array:
    """Return upper triangles of matrices, (size, size, ...) to (size (size + 1) / 2, ...)."""
    column, row = np.tril_indices(len(matrices))
    scale = np.where(row == column, 1.0, np.sqrt(2.0))
    return np.asarray((matrices[row, column].T * scale).T)


def _unvectorise(vector: Array, size: int) -> Array:
    column, row = np.tril_indices(size)
    matrix = np.zeros((size, size))
    matrix[row, column] = vector / np.where(row == column, 1.0, np.sqrt(2.0))
    return np.asarray(matrix + np.triu(matrix, 1).T)
