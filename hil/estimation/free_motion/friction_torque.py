"""Torque of friction by the laws that were found."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.bristles import (
    Direction,
    are_successive,
    bent,
    friction_direction,
    sign_of_velocity,
)
from hil.estimation.free_motion.columns import coupled_friction, motor_angle
from hil.estimation.free_motion.friction_terms import TERMS, friction_columns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.result import AxisFriction, FreeMotionFit
    from hil.model.robot import Robot

    Array = NDArray[np.float64]


def friction_torque(
    robot: Robot,
    fit: FreeMotionFit,
    q: Array,
    qd: Array,
    load: Array,
    directions: Sequence[Direction] | None = None,
) -> Array:
    """Torque of friction and ripple of all axes, shape of `q` [N m or N].

    Parameters
    ----------
    q, qd : ndarray, shape (n, n_joints) or (n_joints,)
        [rad or m, and per s].
    load : ndarray, shape of `q`
        Torque of the rigid bodies [N m or N].
    directions : sequence (n_joints,) of Direction, optional
        Of each axis's friction; by default that along the rows, where these are successive samples
        of a motion, and else the sign of the velocity.
    """
    q_rows, qd_rows, loads = (np.reshape(x, (-1, robot.n_joints)) for x in (q, qd, load))
    if directions is None:
        directions = _directions(fit, q_rows, qd_rows)
    found = np.column_stack(
        [
            _axis(robot, law, q_rows, qd_rows[:, axis], loads[:, axis], directions[axis], axis)
            for axis, law in enumerate(fit.axes)
        ]
    )
    shared = [part for each in fit.coupled for part in (each.viscous.value, each.coulomb.value)]
    for axis in range(robot.n_joints if shared else 0):
        found[:, axis] += coupled_friction(robot, qd_rows, axis) @ np.array(shared)
    return found.reshape(np.shape(q))


def _directions(fit: FreeMotionFit, q: Array, qd: Array) -> list[Direction]:
    successive, found = are_successive(q, qd), []
    for law, positions, velocities in zip(fit.axes, q.T, qd.T, strict=True):
        if successive and law.presliding:
            found.append(bent(partial(friction_direction, positions), law.presliding))
        else:
            sign = sign_of_velocity(velocities, law.speed)
            found.append(Direction(sign, np.zeros_like(sign)))
    return found


def _axis(
    robot: Robot,
    law: AxisFriction,
    q: Array,
    qd: Array,
    load: Array,
    direction: Direction,
    axis: int,
) -> Array:
    angle, slow = motor_angle(robot, q, axis), np.zeros(len(qd))
    columns = friction_columns(qd / law.speed, direction, load, angle, slow)
    chosen = [TERMS.index(term) for term in law.terms]
    return np.asarray(columns[:, chosen] @ np.array([law.terms[TERMS[k]].value for k in chosen]))
