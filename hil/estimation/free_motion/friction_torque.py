"""Torque of friction by the laws that were found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.columns import coupled_friction, motor_angle
from hil.estimation.free_motion.friction_terms import TERMS, friction_columns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.free_motion.result import AxisFriction, FreeMotionFit
    from hil.model.robot import Robot

    Array = NDArray[np.float64]


def friction_torque(robot: Robot, fit: FreeMotionFit, q: Array, qd: Array, load: Array) -> Array:
    """Torque of friction and ripple of all axes, shape of `q` [N m or N].

    Parameters
    ----------
    q, qd : ndarray, shape (n, n_joints) or (n_joints,)
        [rad or m, and per s].
    load : ndarray, shape of `q`
        Torque of the rigid bodies [N m or N].
    """
    q_rows, qd_rows, loads = (np.reshape(x, (-1, robot.n_joints)) for x in (q, qd, load))
    found = np.column_stack(
        [_axis(robot, law, q_rows, qd_rows, loads, axis) for axis, law in enumerate(fit.axes)]
    )
    shared = [part for each in fit.coupled for part in (each.viscous.value, each.coulomb.value)]
    for axis in range(robot.n_joints if shared else 0):
        found[:, axis] += coupled_friction(robot, qd_rows, axis) @ np.array(shared)
    return found.reshape(np.shape(q))


def _axis(robot: Robot, law: AxisFriction, q: Array, qd: Array, load: Array, axis: int) -> Array:
    u = qd[:, axis] / law.speed
    angle = motor_angle(robot, q, axis)
    columns = friction_columns(u, np.sign(u), load[:, axis], angle, np.zeros(len(u)))
    chosen = [TERMS.index(term) for term in law.terms]
    return np.asarray(columns[:, chosen] @ np.array([law.terms[TERMS[k]].value for k in chosen]))
