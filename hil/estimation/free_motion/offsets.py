"""Offsets of friction that pass for weight, or for Coulomb's friction.

On an axis that slides vertically, or turns through a small angle, weight is as constant as an
offset of friction: only inertia distinguishes them, which a gentle motion hardly shows. But the
offset is not just anything. It is what friction differs by between directions, and what a current
sensor adds, some `ASYMMETRY` of friction itself.

So where most of an offset's variance comes from what it shares with base parameters, and the offset
is larger than its variance and that allow, either it is a real one, a sensor's zero or a spring, or
the model lacks something that passes for acceleration. The torques do not show which, so the
estimate stays and its covariance grows along the way that changes them least, until
o^2 = s^2 + V_oo with s = `ASYMMETRY` times friction at half the speed: the value of the greatest
likelihood.

On an axis that moves in one direction only, offset and Coulomb's friction are one column. Either
may be all of their sum, so each is uncertain by half of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.friction.direction import Direction
from hil.friction.terms import friction_columns
from hil.least_squares.solving import solved

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.layout import Layout

ASYMMETRY = 0.15
"""Usual offset as a share of friction at half the speed: 5, 17, 5, 4 and 1 % on five joints of the
TX40, 16 % on EMPS."""


def with_doubt(x: Array, V: Array, metric: Array, layout: Layout) -> tuple[Array, list[int]]:
    """Enlarge a covariance where unusual offsets pass for weight.

    Parameters
    ----------
    x : ndarray, shape (n,)
        All unknowns.
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
    unusual, n_shared = [], len(layout.shared)
    for axis in range(layout.n_channels):
        place = layout.index("offset", axis)
        s = ASYMMETRY * _friction(x[layout.place(axis)[n_shared:]])
        more = float(x[place] ** 2 - s**2 - V[place, place])
        # share of an offset's variance that comes from base parameters, from which on it counts:
        # without them it would be three times as certain, 1 / sqrt(1 - 0.9)
        if more > 0.0 and _shared(V, place, n_shared) >= 0.9:
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


def only_directions(moving: Blocks) -> dict[int, int]:
    """Axes, from 0, that move in one direction alone, 1 or -1, by samples that are not slow.

    Friction of an axis at rest is any up to Coulomb's.
    """
    offset, Coulomb = moving.place("offset", "Coulomb")
    excess, sizes = moving.products[:, :, (offset, Coulomb), Coulomb].sum(axis=0).T
    # share w of the samples under way that go in the other direction, below which an axis moves in
    # one direction only: there offset and Coulomb friction are at least sqrt(1 / w + 1) / 2 = 5
    # times as uncertain as their sum
    one = np.abs(excess) > (1.0 - 2.0 * 0.01) * sizes
    return {int(axis): int(np.sign(excess[axis])) for axis in np.flatnonzero(one & (excess != 0))}


def split_covariance(directions: dict[int, int], layout: Layout, x: Array) -> Array:
    """Covariance of how offset and Coulomb friction share their sum, shape (n, n)."""
    found = np.zeros((len(x), len(x)))
    for axis, direction in directions.items():
        places = [layout.index(term, axis) for term in ("offset", "Coulomb")]
        both = np.array([1.0, direction])
        exchanged = both @ x[places] / 2.0 * np.array([1.0, -direction])
        found[np.ix_(places, places)] = np.outer(exchanged, exchanged)
    return found
