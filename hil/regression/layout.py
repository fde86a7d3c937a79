"""Where unknowns stand: those that all axes share come first, then those of each axis alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]


def axis_place(n_shared: int, n_own: int, axis: int) -> Indices:
    """Places of the shared unknowns and of one axis's own among all, shape (n_shared + n_own,).

    Parameters
    ----------
    n_shared : int
        Unknowns that all axes share.
    n_own : int
        Unknowns of each axis alone.
    axis : int
        From 0.
    """
    first = n_shared + axis * n_own
    return np.concatenate([np.arange(n_shared), np.arange(first, first + n_own)])


def embedded(x: Array, kept: Indices, n: int) -> Array:
    """Kept unknowns among all `n`, the others zero.

    Parameters
    ----------
    x : ndarray, shape (n_kept,) or (n_kept, n_kept)
        Values of the kept unknowns, or a covariance of theirs.
    kept : ndarray of int, shape (n_kept,)

    Returns
    -------
    ndarray, shape (n,) or (n, n)
    """
    found = np.zeros((n,) * x.ndim)
    found[np.ix_(*[kept] * x.ndim)] = x
    return found
