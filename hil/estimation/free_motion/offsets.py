"""Offsets of friction that pass for weight.

On an axis that slides vertically, or turns through a small angle, weight is as constant as an
offset of friction: only inertia distinguishes them, which a gentle motion hardly shows. But the
offset is not just anything. It is what friction differs by between directions, and what a current
sensor adds, some `ASYMMETRY` of friction itself: 5, 17, 5, 4 and 1 % on five joints of the TX40,
16 % on EMPS.

So where most of an offset's variance comes from what it shares with base parameters, this is taken
as one more observation of it, 0 with the standard deviation s = `ASYMMETRY` times friction at half
the speed, and all unknowns follow by their covariance V (Kalman's update). If offset and V
contradict s, V is too small there, for a model lacks something: along this direction it is enlarged
until o^2 = s^2 + V_oo, the value of the greatest likelihood.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.bristles import Direction
from hil.estimation.free_motion.friction_terms import COLUMNS, friction_columns
from hil.regression.least_squares import solved

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ASYMMETRY = 0.15
"""Usual offset as a share of friction at half the speed."""
SHARED = 0.9
"""Share of an offset's variance that comes from base parameters, from which on it is observed."""
CHANGED = 0.5
"""Share of the variance that must go for an axis to be named."""


def with_usual_offsets(
    x: Array, V: Array, n_base: int, n_shared: int
) -> tuple[Array, Array, list[int]]:
    """Observe the offsets that pass for weight.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Base parameters, other shared unknowns, all terms of each axis's friction.
    V : ndarray, shape (n, n)
        Covariance; 0 of terms that a law does not have.

    Returns
    -------
    x, V : ndarray
        After all observations.
    axes : list of int
        From 0, whose offset would have been much less certain.
    """
    changed = []
    for axis, first in enumerate(range(n_shared, len(x), len(COLUMNS))):
        place = first + COLUMNS.index("offset")
        if _shared(V, place, n_base) < SHARED:
            continue
        s = ASYMMETRY * _friction(x[first : first + len(COLUMNS)])
        before = V[place, place]
        x, V = _observed(x, V, place, s**2)
        if V[place, place] < CHANGED * before:
            changed.append(axis)
    return x, V, changed


def _shared(V: Array, place: int, n_base: int) -> float:
    """Share of the variance of an unknown that the base parameters' explains."""
    if V[place, place] <= 0:
        return 0.0
    across = V[:n_base, place]
    return float(across @ solved(V[:n_base, :n_base], across)) / float(V[place, place])


def _friction(terms: Array) -> float:
    """Friction of one axis at half its speed, without offset and load."""
    half, still = np.array([0.5, -0.5]), np.zeros(2)
    columns = friction_columns(half, Direction(np.sign(half), still), still, still, still)
    forward, back = columns @ terms
    return abs(float(forward - back)) / 2


def _observed(x: Array, V: Array, place: int, variance: float) -> tuple[Array, Array]:
    """Observe 0 of one unknown, after its variance was enlarged to what is likeliest."""
    found = V[place, place]
    gain = V[:, place] / found
    likely = max(found, x[place] ** 2 - variance)
    V = V + (likely - found) * np.outer(gain, gain)
    total = likely + variance
    return x - gain * likely / total * x[place], V - likely**2 / total * np.outer(gain, gain)
