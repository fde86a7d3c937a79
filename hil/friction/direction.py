"""Direction of an axis's friction: sign of the velocity, or Dahl's model of presliding.

`hil.estimation.nuisances` derives the columns of presliding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.arrays import Array


STILL = 1e-3
"""Share of an axis's reference speed below which friction has no direction: filters ring at
rest."""
STEP = 1.2
"""Factor of the presliding distance for the difference quotient of `bent`."""


class Direction(NamedTuple):
    """Direction of an axis's friction, from -1 to 1, shape (n,), and its derivative.

    `bend` is the derivative with respect to the logarithm of the presliding distance; 0 without
    presliding.
    """

    sign: Array
    bend: Array


def sign_of_velocity(qd: Array, speed: float) -> Array:
    """Return the sign of velocities; 0 below `STILL` times the reference speed `speed`."""
    return np.where(np.abs(qd) < STILL * speed, 0.0, np.sign(qd))


def sign_direction(qd: Array, speed: float) -> Direction:
    """Return the direction of friction without presliding, from velocities."""
    return Direction(sign_of_velocity(qd, speed), np.zeros(len(qd)))


def bent(after: Callable[[float], Array], distance: float) -> Direction:
    """Return the direction and its derivative; `after` returns the direction for a distance."""
    sign = after(distance)
    if distance == 0:
        return Direction(sign, np.zeros_like(sign))
    return Direction(sign, (after(distance * STEP) - after(distance / STEP)) / (2 * np.log(STEP)))


def are_successive(q: Array, qd: Array) -> bool:
    """Return True if rows, shape (n, n_joints), are samples of a motion at even intervals.

    Positions then change from row to row as the velocities demand. Rows with different velocities
    at one position are no motion, nor are rows in reverse order.
    """
    step, mean = np.diff(q, axis=0), (qd[1:] + qd[:-1]) / 2
    size = float(np.sum(mean**2))
    if not size:
        return False
    period = float(np.sum(step * mean)) / size
    apart = float(np.linalg.norm(step - period * mean))
    # tolerance of steps relative to their size: velocities of a recording are noisy
    return period > 0 and apart <= 0.1 * float(np.linalg.norm(step))


def friction_direction(q: Array, distance: float) -> Array:
    """Return the direction of friction by Dahl's model, -1 to 1, shape (n,); 0 before any motion.

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
    # the direction decays exponentially within each run of one sign, so only the state at the
    # beginning of each run has to be computed in sequence
    for k, (s, share) in enumerate(zip(sign[begins].tolist(), kept.tolist(), strict=True)):
        at_begin[k] = z
        z = s - (s - z) * share
    run = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(step))))
    left = np.exp(-(way[1:] - way[begins[run]]) / distance)
    return np.append(0.0, sign - (sign - at_begin[run]) * left)
