"""Solving normal equations whose unknowns differ in size by orders of magnitude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_RIDGE = 1e-12
"""Relative, so that unknowns without excitation stay zero."""


def solved(N: Array, side: Array) -> Array:
    """Solve ``N x = side``, scaled to a unit diagonal.

    Parameters
    ----------
    N : ndarray, shape (n, n)
        Symmetric, positive semi-definite.
    side : ndarray, shape (n,) or (n, k)
    """
    diagonal = np.diag(N)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    scaled = N * np.outer(scale, scale) + _RIDGE * np.eye(len(N))
    solution: Array = (linalg.cho_solve(linalg.cho_factor(scaled), (side.T * scale).T).T * scale).T
    return solution
