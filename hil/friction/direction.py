"""Direction of an axis's friction: the sign of its velocity, or Dahl's model of what follows it.

The latter is explained in `hil.estimation.nuisances`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.arrays import Array


STILL = 1e-3
"""Share of an axis's speed below which it has no direction: what a filter rings on at rest."""
STEP = 1.2
"""Factor of the presliding distance by which its derivative is found."""


class Direction(NamedTuple):
    """Direction of an axis's friction, from -1 to 1, shape (n,), and how it bends.

    The latter is its change with the logarithm of the presliding distance; 0 where friction turns
    round at once.
    """

    sign: Array
    bend: Array


def sign_of_velocity(qd: Array, speed: float) -> Array:
    """Sign of velocities; 0 below `STILL` times `speed`, that the axis hardly ever exceeds."""
    return np.where(np.abs(qd) < STILL * speed, 0.0, np.sign(qd))


def at_once(qd: Array, speed: float) -> Direction:
    """Direction of a friction that turns round at once, from velocities."""
    return Direction(sign_of_velocity(qd, speed), np.zeros(len(qd)))


def bent(after: Callable[[float], Array], distance: float) -> Direction:
    """Direction and bend, from what `after` finds of the direction with some distance."""
    sign = after(distance)
    if distance == 0:
        return Direction(sign, np.zeros_like(sign))
    return Direction(sign, (after(distance * STEP) - after(distance / STEP)) / (2 * np.log(STEP)))


def are_successive(q: Array, qd: Array) -> bool:
    """Whether rows, shape (n, n_joints), are samples of a motion at even intervals.

    Then positions change from row to row as velocities say: velocities at one and the same position
    are no motion, nor are rows in reverse.
    """
    step, mean = np.diff(q, axis=0), (qd[1:] + qd[:-1]) / 2
    size = float(np.sum(mean**2))
    if not size:
        return False
    period = float(np.sum(step * mean)) / size
    apart = float(np.linalg.norm(step - period * mean))
    # difference of steps from what velocities say, over their size, up to which they are the same
    return period > 0 and apart <= 0.1 * float(np.linalg.norm(step))


def friction_direction(q: Array, distance: float) -> Array:
    """Direction of friction, from -1 to 1, shape (n,); 0 before the first motion.

    Parameters
    ----------
    q : ndarray, shape (n,)
        Positions of one axis at successive instants [rad or m].
    distance : float
        Presliding distance [rad or m], above 0.
    """
    step = np.diff(q)
    if not step.any():
        return np.zeros(len(q))
    sign = np.sign(step)
    begins = np.append(0, np.flatnonzero(np.diff(sign)) + 1)
    way = np.append(0.0, np.cumsum(np.abs(step)))
    kept = np.exp(-np.diff(way[np.append(begins, len(step))]) / distance)
    at_begin, z = np.zeros(len(begins)), 0.0
    # a run in one direction after the other; between its ends all samples follow at once
    for k, (s, share) in enumerate(zip(sign[begins].tolist(), kept.tolist(), strict=True)):
        at_begin[k] = z
        z = s - (s - z) * share
    run = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(step))))
    left = np.exp(-(way[1:] - way[begins[run]]) / distance)
    return np.append(0.0, sign - (sign - at_begin[run]) * left)
