"""Friction offsets indistinguishable from gravity or Coulomb friction.

On an axis that slides vertically, or turns through a small angle, weight is as constant as an
offset of friction: only inertia distinguishes the two, and a gentle motion hardly shows inertia.
But the size of the offset is limited: the offset consists of the direction dependence of friction
and the zero error of a current sensor, together some `ASYMMETRY` of friction itself.

Let s be `ASYMMETRY` times the friction at half the speed. If most of the variance V_oo of an offset
o is shared with base parameters, and o^2 > s^2 + V_oo, then either the offset is real, a sensor's
zero error or a spring, or the model lacks a term that resembles acceleration. The torques do not
show which, so the estimate stays and its covariance grows in the direction of least change of the
torques, until o^2 = s^2 + V_oo: the value of the greatest likelihood. An offset significantly above
s is named. A slide along constant gravity with rotor inertia 0 is an exception: the moved mass
includes the rotor, and the offset the rotor's weight, of any size.

On an axis that moves in one direction only, offset and Coulomb friction share a column. Either may
be the whole sum, so each is uncertain by half of the sum.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.intervals import SIGNIFICANT
from hil.friction.direction import Direction
from hil.friction.terms import friction_columns
from hil.least_squares.solving import solved

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.least_squares.layout import Layout
    from hil.model.robot import Robot

ASYMMETRY = 0.15
"""Usual offset as a share of friction at half the speed. Measured: 5, 17, 5, 4 and 1 % on five
joints of the TX40, 16 % on EMPS.
"""


def enlarge_covariance(
    x: Array, V: Array, metric: Array, layout: Layout, degrees: Array, free: Sequence[int] = ()
) -> tuple[Array, list[int]]:
    """Enlarge the covariance of unusual offsets indistinguishable from gravity.

    Parameters
    ----------
    x : ndarray, shape (n,)
        All unknowns.
    V : ndarray, shape (n, n)
        Covariance; 0 for terms not in a law.
    metric : ndarray, shape (n, n)
        Inverse of the normal equations; 0 for terms not in a law. Its columns are the directions of
        least change of the torques.
    degrees : ndarray, shape (n,)
        Degrees of freedom of V.
    free : sequence of int
        Axes, from 0, with a weight in the offset (`weight_in_offset`).

    Returns
    -------
    V : ndarray
    axes : list of int
        Axes with an offset significantly above s, from 0.
    """
    unusual, n_shared = [], len(layout.shared)
    half, still = np.array([0.5, -0.5]), np.zeros(2)
    columns = friction_columns(half, Direction(np.sign(half), still), still, still, still)
    for axis in range(layout.n_channels):
        place = layout.index("offset", axis)
        # friction at half the axis's speed, without offset and load
        forward, back = columns @ x[layout.place(axis)[n_shared:]]
        s = ASYMMETRY * (abs(float(forward - back)) / 2)
        more = float(x[place] ** 2 - s**2 - V[place, place])
        if more <= 0.0 or V[place, place] <= 0 or axis in free:
            continue
        # smallest relevant share of base parameters in an offset's variance: without this share the
        # standard error would be a third, sqrt(1 - 0.9)
        across = V[:n_shared, place]
        explained = float(across @ solved(V[:n_shared, :n_shared], across))
        if explained / float(V[place, place]) >= 0.9:
            tail = SIGNIFICANT / 2.0 / layout.n_channels  # one family of tests
            t = special.stdtrit(degrees[place], 1.0 - tail)
            if abs(x[place]) > s + t * np.sqrt(V[place, place]):
                unusual.append(axis)
            way = metric[:, place] / metric[place, place]
            V = V + more * np.outer(way, way)
    return V, unusual


def weight_in_offset(robot: Robot) -> tuple[int, ...]:
    """Return the slides, from 0, with the weight of the rotor in the offset."""
    return tuple(axis for axis in robot.weighed_slides if robot.rotor_inertia[axis] == 0)


def only_directions(ways: Array) -> dict[int, int]:
    """Return the axes, from 0, moving in a single direction, 1 or -1, outside the dead zone.

    Samples at low speed are ignored: friction of an axis at rest takes any value up to Coulomb
    friction. Samples are counted before the low-pass, whose reach may contain several strokes.

    Parameters
    ----------
    ways : ndarray, shape (n_joints, 2)
        See `hil.estimation.free_motion.accumulation.Products`.
    """
    # largest share w of moving samples in the opposite direction for motion in one direction only:
    # then offset and Coulomb friction are at least sqrt(1 / w + 1) / 2 = 5 times as uncertain as
    # their sum
    one = ways.min(axis=1) < 0.01 * ways.sum(axis=1)
    return {
        axis: 1 if ways[axis, 0] > ways[axis, 1] else -1 for axis in np.flatnonzero(one).tolist()
    }


def split_covariance(directions: dict[int, int], layout: Layout, x: Array) -> Array:
    """Return the covariance of the split between offset and Coulomb friction, (n, n)."""
    found = np.zeros((len(x), len(x)))
    for axis, direction in directions.items():
        places = [layout.index(term, axis) for term in ("offset", "Coulomb")]
        both = np.array([1.0, direction])
        exchanged = both @ x[places] / 2.0 * np.array([1.0, -direction])
        found[np.ix_(places, places)] = np.outer(exchanged, exchanged)
    return found
