"""Columns of the regression: base parameters, coupled motors, and friction of each axis.

Every sample of an axis i says

    Q_i - Qm_i = A_i(q, qd, qdd) p + C_i c + F_i a_i + e

with the torque Qm of rotors whose inertia the robot file states. Friction F of an axis is in
`friction_terms`. A motor that turns with two joints has friction in its own velocity, c_1 (viscous)
and c_2 (Coulomb), which both joints feel: the unknowns c are shared by all axes as p is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.friction_terms import friction_columns
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.model.motors import motor_torque

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.free_motion.motion import Motion
    from hil.model.robot import Robot

ROTOR = "known rotor"
"""Column of the torque of rotors of known inertia."""
SEEN = 0.4
"""Cycles of the motor in a sample up to which ripple over its angle is seen as such."""


def coupled_names(robot: Robot) -> tuple[tuple[str, str], ...]:
    """Viscous and Coulomb friction of each coupled motor, by name."""
    motors = [f"motor {motor + 1} with joint {joint + 1}" for motor, joint, _ in robot.couplings]
    return tuple((f"{name} viscous", f"{name} Coulomb") for name in motors)


def shared_names(robot: Robot) -> tuple[str, ...]:
    """Unknowns that all axes share: base parameters, then two of each coupled motor's friction."""
    return base_parameters(robot).names + tuple(n for pair in coupled_names(robot) for n in pair)


def axis_columns(robot: Robot, motion: Motion, axis: int, first: Array) -> Array:
    """All columns of one axis, at the motion's samples, shape (n, n_shared + 1 + n_terms).

    The torque of the axis's rotor, whose inertia is known, stands behind the shared ones.

    Parameters
    ----------
    first : ndarray, shape (n_base,)
        First estimate of the base parameters, for the torque that is transmitted: it enters a small
        term of friction, so it need not be good.
    """
    q, qd = motion.q, motion.qd
    rows = regressor(robot, q, qd, motion.qdd, joints=[axis])[:, 0]
    friction = friction_columns(
        qd[:, axis] / motion.processing.speed[axis],
        motion.directions[axis],
        rows @ first,
        motor_angle(robot, q, axis),
        motor_angle(robot, qd, axis) / (2 * np.pi) * motion.period / SEEN,
    )
    rotor = rotor_torque(robot, motion, axis)[:, np.newaxis]
    return np.hstack([rows, coupled_friction(robot, qd, axis), rotor, friction])


def motor_angle(robot: Robot, q: Array, axis: int) -> Array:
    """Angle of one axis's motor [rad], or its rate from joint velocities; 0 where unknown."""
    return np.asarray(np.nan_to_num(robot.gear_ratio[axis]) * q[:, axis])


def coupled_friction(robot: Robot, qd: Array, axis: int) -> Array:
    """Columns of the coupled motors' friction as one axis feels it, shape (n, 2 n_couplings)."""
    columns = np.zeros((len(qd), 2 * len(robot.couplings)))
    for k, (motor, joint, ratio) in enumerate(robot.couplings):
        if axis not in (motor, joint):
            continue
        other = motor if axis == joint else joint
        turning = ratio * qd[:, joint] + qd[:, motor]
        columns[:, 2 * k] = ratio * qd[:, other]
        columns[:, 2 * k + 1] = np.sign(turning) * (ratio if axis == joint else 1.0)
    return columns


def rotor_torque(robot: Robot, motion: Motion, axis: int) -> Array:
    """Torque of one axis's rotor, whose inertia is known, shape (n,) [N m or N]."""
    known: Array = motor_torque(robot, motion.q, motion.qd, motion.qdd)[:, axis]
    return known
