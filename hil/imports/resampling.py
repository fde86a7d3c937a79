"""Samples at uneven instants onto an even grid.

Between two samples a cubic takes the values and slopes at both; the slope at a sample is that of
the parabola through it and its neighbours. So parabolas come through unchanged, samples that are on
the grid stay as they are, and nothing depends on samples further away than two.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hil.arrays import Array


def resampled(instants: Array, values: Array, grid: Array) -> Array:
    """Values at the instants of a grid.

    Parameters
    ----------
    instants : array (n,)
        Rising, n of 2 or more [s].
    values : array (n, k)
    grid : array (m,)
        Within the instants [s]; beyond them the last values hold.

    Returns
    -------
    array (m, k)
    """
    interval = np.clip(np.searchsorted(instants, grid, side="right") - 1, 0, len(instants) - 2)
    h = np.diff(instants)[interval]
    u = np.clip((grid - instants[interval]) / h, 0.0, 1.0)
    slopes = _slopes(instants, values)
    before, after = ((values[at], slopes[at] * h[:, None]) for at in (interval, interval + 1))
    u = u[:, None]
    result: Array = (
        (1 + 2 * u) * (1 - u) ** 2 * before[0]
        + u * (1 - u) ** 2 * before[1]
        + u**2 * (3 - 2 * u) * after[0]
        - u**2 * (1 - u) * after[1]
    )
    return result


def _slopes(t: Array, x: Array) -> Array:
    """Slopes of the parabolas through each sample and its neighbours, shape of `x`."""
    h = np.diff(t)[:, None]
    secants = np.diff(x, axis=0) / h
    if len(t) == 2:
        return np.repeat(secants, 2, axis=0)
    inner = (h[1:] * secants[:-1] + h[:-1] * secants[1:]) / (h[1:] + h[:-1])
    first, last = 2 * secants[0] - inner[0], 2 * secants[-1] - inner[-1]
    slopes: Array = np.concatenate([first[None], inner, last[None]])
    return slopes
