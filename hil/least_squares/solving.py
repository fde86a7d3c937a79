"""Linear least squares with unknowns of very different units and sizes.

Observations ``W x = y``, shape (m, n), and their normal equations ``N x = v`` with N = W'W and v =
W'y are equivalent. Every function here scales the unknowns first, so that the columns of W have
unit length,

    N = D R D,    D = diag(sqrt(N_jj)),    R = V S V',

and neither units nor sizes affect rank decisions (van der Sluis, Numer. Math. 14 (1969) 14-23: no
other diagonal scaling has a much better condition). A direction of R is *determined* if its
eigenvalue is above `RANK` times the largest one; undetermined components are set to zero. With the
determined directions V_r, all else follows from one matrix, the root of the inverse,

    B = D^-1 V_r S_r^(-1/2),    B'N B = 1,    B B' = N^+,    x = B B'v,

and W B is an orthonormal basis of the span of W. Some unknowns c are nuisance. With the others p,
the matrix P = [1, -N_pc N_cc^+] eliminates them from the normal equations (Schur complement; in
terms of columns, orthogonal projection after Frisch, Waugh and Lovell):

    (P N)_p p = P v,    (P N)_c = 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.arrays import Array, Mask


Number = TypeVar("Number", np.float64, np.complex128)
RANK = 1e-12
"""Rank tolerance as share of the largest eigenvalue of R, squared share of singular values."""
IDENTIFIABLE = 1e-8
"""Rank tolerance for unknowns of interest, as opposed to auxiliary ones: a condition number of unit
columns of 1e4. Noise and friction always cause torque errors of 1e-4 or more. Beyond this condition
number, such an error is as large as the torque of the worst combination of unknowns, standard
errors do not cover the effect of misfit, and normal equations have lost half of 16 digits."""
SILENT = 1e-12
"""Largest norm of a zero column by rounding, as share of the longest."""
RIDGE = 1e-12
"""Ridge added to the unit diagonal of R, so that unknowns without excitation stay zero."""


def solved(N: Array, side: Array) -> Array:
    """Solve normal equations ``N x = side``; unknowns without excitation stay zero.

    Fast enough for leave-one-out loops.

    Parameters
    ----------
    N : ndarray, shape (n, n)
        Symmetric, positive semi-definite.
    side : ndarray, shape (n,) or (n, k)

    Returns
    -------
    x : ndarray, shape of `side`
    """
    scale = _unit_scale(np.diag(N))
    scaled = N * np.outer(scale, scale) + RIDGE * np.eye(len(N))
    return (np.linalg.solve(scaled, (side.T * scale).T).T * scale).T


def solve_each(N: Array, sides: Array) -> Array:
    """Solve a stack of equations, shapes (k, n, n) and (k, n)."""
    scale = _unit_scale(np.diagonal(N, axis1=1, axis2=2))
    scaled = N * scale[:, :, np.newaxis] * scale[:, np.newaxis] + RIDGE * np.eye(N.shape[-1])
    return np.linalg.solve(scaled, (sides * scale)[..., np.newaxis])[..., 0] * scale


def inverse_root(N: Array, rank: float = RANK, size: Array | None = None) -> Array:
    """Compute B with ``B'N B = 1`` and ``B B' = N^+``, shape (n, number of determined directions).

    If N is a covariance, B' whitens.

    Parameters
    ----------
    N : ndarray, shape (n, n)
        Symmetric, positive semi-definite.
    rank : float
        Share of the largest eigenvalue of R, or of 1 if less, above which a direction is
        determined.
    size : ndarray, shape (n,), optional
        Squares of D in place of the diagonal of N, for an N after elimination, whose diagonal is
        small compared with that before.
    """
    scale, values, vectors = _decompose(N, size)
    kept = _select_determined(values, rank)
    return scale[:, np.newaxis] * vectors[:, kept] / np.sqrt(values[kept])


def inverse(N: Array, rank: float = RANK, size: Array | None = None) -> Array:
    """Compute N^+, shape (n, n), zero in undetermined directions; cf. `inverse_root`."""
    root = inverse_root(N, rank, size)
    return root @ root.T


def undetermined(N: Array, rank: float = RANK, size: Array | None = None) -> Mask:
    """Return True for unknowns with a part in undetermined directions, shape (n,)."""
    _, values, vectors = _decompose(N, size)
    part = np.linalg.norm(vectors[:, ~_select_determined(values, rank)], axis=1)
    # tolerance on the component in undetermined directions
    found: Mask = part > 1e-3
    return found


def null_space(N: Array, rank: float = RANK, size: Array | None = None) -> Array:
    """Return the undetermined directions of the unknowns, shape (n, number of directions)."""
    scale, values, vectors = _decompose(N, size)
    free = vectors[:, ~_select_determined(values, rank)]
    return free * np.where(scale > 0, scale, 1.0)[:, np.newaxis]


def undetermined_beside(N: Array, n: int) -> Mask:
    """Return True for the first `n` unknowns not `IDENTIFIABLE` beside the rest, shape (n,).

    The information after elimination of the rest is compared with the information before.

    Parameters
    ----------
    N : ndarray, shape (n + k, n + k)
    """
    left = nuisance_elimination(N, n) @ N[:, :n]
    return undetermined(left, IDENTIFIABLE, np.diag(N)[:n])


def condition(N: Array) -> float:
    """Compute the condition number of columns of unit length, without zero columns; inf if empty.

    Parameters
    ----------
    N : ndarray, shape (n, n)
    """
    heard = np.diag(N) > 0
    if not heard.any():
        return np.inf
    size = 1.0 / np.sqrt(np.diag(N)[heard])
    return float(np.sqrt(np.linalg.cond(N[np.ix_(heard, heard)] * np.outer(size, size))))


def project_out(Q: Array, x: NDArray[Number]) -> NDArray[Number]:
    """Project `x` onto the complement of the span of orthonormal columns `Q`, shape of `x`.

    Parameters
    ----------
    Q : ndarray, shape (m, r)
    x : ndarray, shape (m,) or (m, k)
    """
    return np.asarray(x - Q @ (Q.T @ x))


def orthonormal(W: Array, rank: float = RANK) -> tuple[Array, Array]:
    """Compute Q = W B with orthonormal columns of the same span as W, and B.

    Parameters
    ----------
    W : ndarray, shape (m, n)

    Returns
    -------
    Q : ndarray, shape (m, r)
    B : ndarray, shape (n, r)
        Root of the inverse of W'W, from W itself, not from its square.
    """
    scale = _unit_scale(np.sum(W**2, axis=0))
    Q, sizes, turned = np.linalg.svd(W * scale, full_matrices=False)
    kept = _select_determined(sizes[::-1] ** 2, rank)[::-1]
    return Q[:, kept], scale[:, np.newaxis] * turned[kept].T / sizes[kept]


def fitted(W: Array, y: Array) -> Array:
    """Solve ``W x = y`` by least squares.

    Parameters
    ----------
    W : ndarray, shape (m, n)
    y : ndarray, shape (m,) or (m, k)

    Returns
    -------
    x : ndarray, shape (n,) or (n, k)
    """
    Q, B = orthonormal(W)
    return B @ (Q.T @ y)


def eliminated(product: Array, k: int) -> tuple[Array, int]:
    """Eliminate the last `k` columns from inner products; return the rest and the eliminated rank.

    Parameters
    ----------
    product : ndarray, shape (n + k, n + k)

    Returns
    -------
    product : ndarray, shape (n, n)
    rank : int
    """
    n = len(product) - k
    within = product[:n, n:] @ inverse_root(product[n:, n:])
    return product[:n, :n] - within @ within.T, within.shape[1]


def nuisance_elimination(N: Array, n: int) -> Array:
    """Compute P, which eliminates all unknowns after the first `n` from normal equations.

    Parameters
    ----------
    N : ndarray, shape (n + k, n + k)

    Returns
    -------
    P : ndarray, shape (n, n + k)
    """
    return np.hstack([np.eye(n), -N[:n, n:] @ inverse(N[n:, n:])])


def shares_without_nuisance(shares: Array, sides: Array, n: int) -> tuple[Array, Array]:
    """Compute the measurements' normal equations for the first `n` unknowns.

    The sums over measurements are the normal equations with the nuisances eliminated. Nuisances are
    fixed at the joint solution.

    Parameters
    ----------
    shares : ndarray, shape (n_measurements, n + k, n + k)
        N of each measurement.
    sides : ndarray, shape (n_measurements, n + k)
        v of each.

    Returns
    -------
    shares : ndarray, shape (n_measurements, n, n)
    sides : ndarray, shape (n_measurements, n)
    """
    N, v = shares.sum(axis=0), sides.sum(axis=0)
    P, nuisance = nuisance_elimination(N, n), inverse(N[n:, n:]) @ v[n:]
    rows = P @ shares
    return rows @ P.T, sides @ P.T - rows[:, :, n:] @ nuisance


def _unit_scale(squares: Array) -> Array:
    """Compute reciprocal lengths of columns from squares; zero for negligible columns."""
    heard = squares > SILENT**2 * squares.max(axis=-1, initial=0.0, keepdims=True)
    return np.where(heard, 1.0, 0.0) / np.sqrt(np.where(heard, squares, 1.0))


def _decompose(N: Array, size: Array | None) -> tuple[Array, Array, Array]:
    """Compute D^-1, eigenvalues of R in ascending order, and eigenvectors as columns."""
    scale = _unit_scale(np.diag(N) if size is None else size)
    values, vectors = np.linalg.eigh(N * np.outer(scale, scale))
    return scale, values, vectors


def _select_determined(values: Array, rank: float) -> Mask:
    """Return True for eigenvalues of R, in ascending order, of determined directions."""
    found: Mask = values > rank * max(1.0, values.max(initial=0.0))
    return found
