"""Low-pass of the improved method, and differences for velocities.

The Blackman window is phase-neutral and ends after `HALF_WIDTH`: a sample further than that from a
reversal is not affected by it. Recordings and predictions pass the same window. This module uses
NumPy alone, since importing SciPy would take longer than a plan or dry run.

The differences are of fourth order in the sampling period. The estimator applies them
(`hil.estimation.signals`); predictions compute their effect on encoder increments
(`hil.planning.prediction.information`).

Few of the samples are used, since the window makes samples closer than its width redundant. Means
are computed only there, by multiplication with a sparse matrix.
"""

from __future__ import annotations

from functools import cache, reduce
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy import sparse

    from hil.arrays import Array, Mask


FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
"""First difference, for a sampling period of 1."""
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
"""Second difference, for a sampling period of 1."""
Number = TypeVar("Number", np.float64, np.complex128)


def jerk_window(period: float) -> Array:
    """Return the taps of the filter for jerk, used to detect corners of a motion."""
    return np.asarray(np.convolve([0.5, 0.0, -0.5], rounding_window(period)) / period)


def rounding_window(period: float) -> Array:
    """Return the filter taps from positions, every `period` [s], to smoothed accelerations."""
    return np.asarray(np.convolve(SECOND, weights(period)) / period**2)


HALF_WIDTH = 0.024
"""Half-width of the window [s]."""
LONGEST = HALF_WIDTH / 4.0 * (1.0 + 1e-9)
"""Longest sampling period with four samples on either side of the window's middle [s]; a longer one
is a slow SYNC."""
APART = 0.012
"""Interval between used samples [s]: the window removes faster content."""


def smooth(x: Array, period: float) -> Array:
    """Compute the weighted mean over the window along the first axis; `period` in s."""
    return correlate(x, weights(period))


def correlate(x: Array, taps: Array) -> Array:
    """Correlate samples with `taps`, with constant extension at the ends."""
    n, reach = len(x), len(taps) // 2
    flat = x.reshape(n, -1)
    # np.pad takes as long as the following lines together
    padded = np.empty((flat.shape[1], n + 2 * reach))
    padded[:, :reach], padded[:, n + reach :] = flat[:1].T, flat[-1:].T
    padded[:, reach : n + reach] = flat.T
    sums = np.empty(flat.shape)
    for k, column in enumerate(padded):
        sums[:, k] = np.correlate(column, taps, mode="valid")
    return sums.reshape(x.shape)


def widen(mask: Mask, reach: int, *, beyond: bool = False) -> Mask:
    """Widen a mask by `reach` samples; `beyond` is the assumed value outside the ends."""
    count = np.cumsum(np.pad(mask, (reach + 1, reach), constant_values=beyond))
    return count[2 * reach + 1 :] > count[: -2 * reach - 1]


def half_window(period: float) -> int:
    """Return the number of window samples on either side of the centre."""
    return max(2, round(HALF_WIDTH / period))


def noise_gain(period: float) -> float:
    """Compute the variance of white noise after the window."""
    return float(np.sum(weights(period) ** 2))


@cache
def weights(period: float) -> Array:
    """Return the window's weights, for samples every `period` [s]; the sum is 1."""
    window = np.blackman(2 * half_window(period) + 3)[1:-1]
    window /= window.sum()
    window.flags.writeable = False
    return window


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
    from scipy import sparse  # noqa: PLC0415 - plans need no SciPy

    window = reduce(np.convolve, [weights(period)] * passes)
    first = index[:, np.newaxis] - len(window) // 2
    places = (first + np.arange(len(window))).ravel()
    rows = len(window) * np.arange(len(index) + 1)
    return sparse.csr_array(
        (np.tile(window, len(index)), places, rows), shape=(len(index), n_samples)
    )
