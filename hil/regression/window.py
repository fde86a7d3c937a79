"""The low-pass of the improved method: a Blackman window.

It is phase-neutral and ends after `HALF_WIDTH`: a sample further than that from a reversal knows
nothing of it. What is measured passes it, and so does what is foreseen of a measurement.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

HALF_WIDTH = 0.024
"""Of the window [s]."""
APART = 0.012
"""Between samples that are used: the window leaves nothing in between [s]."""


def smooth(x: Array, period: float) -> Array:
    """Weighted mean over the window along the first axis, of samples every `period` [s]."""
    mean: Array = ndimage.correlate1d(x, weights(period), axis=0, mode="nearest")
    return mean


def widened(mask: Mask, reach: int, *, beyond: bool = False) -> Mask:
    """Samples within `reach` of those of a mask; `beyond`: what the mask is outside its ends."""
    found: Mask = ndimage.maximum_filter1d(mask, 2 * reach + 1, mode="constant", cval=beyond)
    return found


def half_window(period: float) -> int:
    """Samples on either side of the middle one."""
    return max(2, round(HALF_WIDTH / period))


def noise_gain(period: float) -> float:
    """Variance that the window leaves of white noise."""
    return float(np.sum(weights(period) ** 2))


def weights(period: float) -> Array:
    """Of the window's samples, one every `period` [s]; their sum is 1."""
    window = np.blackman(2 * half_window(period) + 3)[1:-1]
    return np.asarray(window / window.sum())
