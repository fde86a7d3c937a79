"""The low-pass of the improved method at some samples only, for all columns at once.

Of samples that follow each other faster than the window is wide, few are used: the window leaves
nothing in between. Means are taken there alone.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from hil.regression.window import weights

if TYPE_CHECKING:
    from numpy.typing import NDArray

Number = TypeVar("Number", np.float64, np.complex128)


def smoothed_at(
    index: NDArray[np.intp], x: NDArray[Number], period: float, passes: int = 1
) -> NDArray[Number]:
    """Weighted means over the window at the samples `index` of `x`.

    Parameters
    ----------
    index : ndarray, shape (n,)
        Further from both ends than `passes` half windows reach.
    x : ndarray, shape (n_samples, k)
        Samples every `period` [s].
    passes : int
        How often the window is taken.

    Returns
    -------
    means : ndarray, shape (n, k)
    """
    window = reduce(np.convolve, [weights(period)] * passes)
    first = index[:, np.newaxis] - len(window) // 2
    around = x[first + np.arange(len(window))]
    return np.asarray(window @ around)
