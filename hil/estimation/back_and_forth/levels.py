"""Friction of one recording as columns, without a law: any odd function of the velocity.

    f = sign(v) sum_j c_j h_j(|v|) + sum_k T_k(t) (a_k sign(v) + b_k v)

The h_j interpolate linearly between levels at speeds that the strokes themselves have, so any curve
is among them. Each pair k has a level a_k and a slope b_k of its own at its turning point; between
two pairs the T_k interpolate in time, and go on beyond the first and the last one. A stroke back
always comes later than the one forth, so a trend would shift all half-sums; it is read off the
half-differences of successive pairs, and taken off.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.back_and_forth.pairs import Pair

    Array = NDArray[np.float64]

LEVELS = 8
"""Speeds between which the curve of friction is interpolated, at most."""
APART = 0.04
"""Of them, at least, as share of the recording's speed."""


def friction_columns(u: Array, time: Array, pairs: Sequence[Pair]) -> Array:
    """Columns of friction at the filtered samples, shape (n, n_columns); rank may be less.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Velocity of the axis as share of the recording's speed.
    time : ndarray, shape (n,)
        [s].
    pairs : sequence of Pair
    """
    used = np.concatenate([np.concatenate([pair.forth, pair.back]) for pair in pairs])
    knots = _apart(np.quantile(np.abs(u[used]), np.linspace(0.0, 1.0, LEVELS)))
    curve = [np.interp(np.abs(u), knots, unit) for unit in np.eye(len(knots))]
    turning = [(time[pair.forth[-1]] + time[pair.back[0]]) / 2 for pair in pairs]
    steady = _interpolating(time, np.array(turning))
    direction, u = np.sign(u)[:, np.newaxis], u[:, np.newaxis]
    return np.hstack([direction * np.column_stack(curve), direction * steady, u * steady])


def _apart(speeds: Array) -> Array:
    """Those of rising speeds that differ by `APART` from the one before."""
    found = [float(speeds[0])]
    for speed in speeds[1:]:
        if speed >= found[-1] + APART:
            found.append(float(speed))
    return np.array(found)


def _interpolating(time: Array, knots: Array) -> Array:
    """Weights that interpolate linearly between rising knots, and go on beyond them, (n, k)."""
    if len(knots) == 1:
        return np.ones((len(time), 1))
    left = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
    share = (time - knots[left]) / (knots[left + 1] - knots[left])
    found = np.zeros((len(time), len(knots)))
    rows = np.arange(len(time))
    found[rows, left], found[rows, left + 1] = 1.0 - share, share
    return found
