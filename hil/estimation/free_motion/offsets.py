"""Offsets of friction that pass for weight.

On an axis that slides vertically, or turns through a small angle, weight is as constant as an
offset of friction: only inertia distinguishes them, which a gentle motion hardly shows. But the
offset is not just anything. It is what friction differs by between directions, and what a current
sensor adds, some `ASYMMETRY` of friction itself: 5, 17, 5, 4 and 1 % on five joints of the TX40,
16 % on EMPS.

So where most of an offset's variance comes from what it shares with base parameters, and the offset
is larger than its variance and that allow, either it is a real one, a sensor's zero or a spring, or
the model lacks something that passes for acceleration. The torques do not tell which, so the
estimate stays and its covariance grows along the way that changes them least, until
o^2 = s^2 + V_oo with s = `ASYMMETRY` times friction at half the speed: the value of the greatest
likelihood.
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
"""Share of an offset's variance that comes from base parameters, from which on it counts: without
them it would be three times as certain, 1 / sqrt(1 - 0.9)."""


def with_doubt(x: Array, V: Array, metric: Array, n_shared: int) -> tuple[Array, list[int]]:
    """Enlarge a covariance where unusual offsets pass for weight.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Base parameters, other shared unknowns, all terms of each axis's friction.
    V : ndarray, shape (n, n)
        Covariance; 0 of terms that a law does not have.
    metric : ndarray, shape (n, n)
        Inverse of the normal equations, 0 likewise: its columns lead where torques change least.

    Returns
    -------
    V : ndarray
    axes : list of int
        From 0, whose offset is unusual.
    """
    unusual = []
    for axis, first in enumerate(range(n_shared, len(x), len(COLUMNS))):
        place = first + COLUMNS.index("offset")
        s = ASYMMETRY * _friction(x[first : first + len(COLUMNS)])
        more = float(x[place] ** 2 - s**2 - V[place, place])
        if more > 0.0 and _shared(V, place, n_shared) >= SHARED:
            way = metric[:, place] / metric[place, place]
            V = V + more * np.outer(way, way)
            unusual.append(axis)
    return V, unusual


def _shared(V: Array, place: int, n_shared: int) -> float:
    """Share of the variance of an unknown that the shared ones' explains."""
    if V[place, place] <= 0:
        return 0.0
    across = V[:n_shared, place]
    return float(across @ solved(V[:n_shared, :n_shared], across)) / float(V[place, place])


def _friction(terms: Array) -> float:
    """Friction of one axis at half its speed, without offset and load."""
    half, still = np.array([0.5, -0.5]), np.zeros(2)
    columns = friction_columns(half, Direction(np.sign(half), still), still, still, still)
    forward, back = columns @ terms
    return abs(float(forward - back)) / 2
