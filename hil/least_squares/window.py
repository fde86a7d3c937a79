"""Low-pass of the improved method, differences for velocities, and detection of moving axes.

The Blackman window is phase-neutral and ends after `HALF_WIDTH`: a sample further than that from a
reversal is not affected by it. Recordings and predictions pass the same window. This module uses
NumPy alone, since importing SciPy would take longer than a plan or dry run.

The differences are of fourth order in the sampling period. The estimator applies them
(`hil.estimation.signals`); predictions compute their effect on encoder increments
(`hil.planning.prediction.information`).

Noise is the scatter of positions about parabolas over spans too short for a robot to reverse, or
the rounding to encoder increments. An axis moves if its range, with noise averaged over these
spans, is wider than the noise band; a locked axis with a noisy encoder counts as standing.

Few of the samples are used, since the window makes samples closer than its width redundant. Means
are computed only there, by multiplication with a sparse matrix.
"""

from __future__ import annotations

from functools import cache, reduce
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from scipy import sparse

    from hil.arrays import Array, Mask


FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
"""First difference, for a sampling period of 1."""
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
"""Second difference, for a sampling period of 1."""
SPAN = 0.1
"""Duration of a parabola [s]: motion up to 3 Hz, guided or planned, deviates from it by 2 %.
"""
FEWEST = 5
"""Minimum number of samples of a span: two more than the parabola's coefficients."""
CARRIED = 1e-4
"""Largest deflection of a standing axis, relative to the widest range of the axes: servos hold arms
to some 0.1 mrad during motions of some rad (the twins of `tests/robots`)."""
ROUNDING = 1e-9
"""Rounding of converted counts, relative to the position: a count of 32 bits has 2e-10."""
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


class Extent(NamedTuple):
    """Lowest and highest mean of spans, and noise, each (n_joints,)."""

    low: Array
    high: Array
    noise: Array


def extent(q: Array, period: float) -> Extent:
    """Compute the extent of positions (n, n_joints) sampled every `period` [s]."""
    span = max(FEWEST, round(SPAN / period))
    if len(q) < span:
        return Extent(q.min(axis=0), q.max(axis=0), np.zeros(q.shape[1]))
    spans = q[: len(q) // span * span].reshape(-1, span, q.shape[1])
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, span), 3))
    left = spans - basis @ (basis.T @ spans)
    size = max(float(np.abs(left).max()), np.finfo(float).tiny)  # scaled: squares may overflow
    scatter = size * np.sqrt(((left / size) ** 2).sum(axis=(0, 1)) / (len(spans) * (span - 3)))
    means = spans.mean(axis=1)
    noise = np.maximum(scatter, [increment(each) / np.sqrt(12.0) for each in q.T])
    return Extent(means.min(axis=0), means.max(axis=0), noise)


def moving(extents: Sequence[Extent]) -> Mask:
    """Find the moving axes from the extents of the recordings, shape (n_joints,)."""
    low, high, noise = (np.array(each) for each in zip(*extents, strict=True))
    reach = high.max(axis=0) - low.min(axis=0)
    # width of the noise band: 5 standard deviations to either side, exceeded by one of two million
    # samples
    band = np.maximum(10.0 * noise.max(axis=0), CARRIED * reach.max())
    return np.asarray(reach > np.maximum(band, ROUNDING * np.abs([low, high]).max(axis=(0, 1))))


def increment(x: Array) -> float:
    """Return the least difference of distinct values, apart from rounding of converted counts."""
    steps = np.diff(np.sort(x))  # a tenth of the time of np.unique
    # positions in rad or m: increments are no smaller than those of a range of 1
    real = steps[steps > ROUNDING * max(1.0, float(np.abs(x).max()))]
    return float(real.min(initial=np.inf)) if len(real) else 0.0


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
