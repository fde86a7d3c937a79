"""Low-pass of the improved method at selected samples, for several columns at once.

Few of the samples are used, since the window makes samples closer than its width redundant. Means
are computed only there, by multiplication with a sparse matrix.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from scipy import sparse

from hil.least_squares.window import weights

if TYPE_CHECKING:
    from numpy.typing import NDArray

Number = TypeVar("Number", np.float64, np.complex128)


def smooth_at(
    index: NDArray[np.intp], x: NDArray[Number], period: float, passes: int = 1
) -> NDArray[Number]:
    """Compute weighted means over the window at the samples `index` of `x`.

    Parameters
    ----------
    index : ndarray, shape (n,)
        Indices more than `passes` half windows away from both ends.
    x : ndarray, shape (n_samples, k)
        Samples every `period` [s].
    passes : int
        Number of passes of the window.

    Returns
    -------
    means : ndarray, shape (n, k)
    """
    flat = np.ascontiguousarray(x).view(np.float64)  # complex columns count as two each
    return np.asarray(window_means(index, len(x), period, passes) @ flat).view(x.dtype)


def window_means(
    index: NDArray[np.intp], n_samples: int, period: float, passes: int = 1
) -> sparse.csr_array:
    """Return the matrix of `smooth_at`, shape (n, n_samples)."""
    window = reduce(np.convolve, [weights(period)] * passes)
    first = index[:, np.newaxis] - len(window) // 2
    places = (first + np.arange(len(window))).ravel()
    rows = len(window) * np.arange(len(index) + 1)
    return sparse.csr_array(
        (np.tile(window, len(index)), places, rows), shape=(len(index), n_samples)
    )
