"""Columns of the regression: base parameters, coupled motors, and friction of each axis.

Every sample of an axis i gives the equation

    Q_i - Qm_i = A_i(q, qd, qdd) p + C_i c + F_i a_i + e

with the torque Qm of rotors of known inertia (robot file). Friction F of an axis is in
`hil.friction.terms`. A motor coupled to two joints has friction in its own velocity, c_1 (viscous)
and c_2 (Coulomb), acting on both joints: the unknowns c are shared by all axes, as p is. So are the
compliances of soft gears (`hil.estimation.nuisances`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import side_by_side
from hil.estimation.nuisances import compliance_names, gear_columns
from hil.friction.ripple import RIPPLE_ORDERS, ripple_orders
from hil.friction.terms import COLUMNS, WAVES, coupled_friction, friction_columns, motor_angle
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.free_motion.motion import Motion
    from hil.model.robot import Robot

SEEN = 0.4
"""Largest motor angle per sample [cycles] with resolved ripple."""


def coupled_names(robot: Robot) -> tuple[tuple[str, str], ...]:
    """Return the names of viscous and Coulomb friction of the coupled motors."""
    motors = [f"motor {motor + 1} with joint {joint + 1}" for motor, joint, _ in robot.couplings]
    return tuple((f"{name} viscous", f"{name} Coulomb") for name in motors)


def shared_names(robot: Robot, soft: Sequence[int] = ()) -> tuple[str, ...]:
    """Return the shared unknowns: base parameters, coupled motors' friction, compliances."""
    coupled, gears = coupled_names(robot), compliance_names(robot)
    rigid = base_parameters(robot).names + tuple(n for pair in coupled for n in pair)
    return rigid + tuple(gears[axis] for axis in soft)


def soft_gears(robot: Robot, motion: Motion, p: Array, soft: Sequence[int]) -> Array:
    """Return torques of a compliance `STEP` of every soft gear, (n, n_joints, n_soft).

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        Base parameters for the calculation of the transmitted torques.
    """
    state = motion.q, motion.qd, motion.qdd
    if not soft:
        return np.zeros((*motion.q.shape, 0))
    load = inverse_dynamics(robot, p, *state)
    twist = motion.processing.smoothed(load, motion.period, derivatives=2)
    return gear_columns(robot, p, state, twist)[:, :, list(soft)]


def axis_columns(
    robot: Robot,
    motion: Motion,
    axis: int,
    rows: Array,
    first: Array,
    terms: Sequence[str] = COLUMNS,
    gears: Array | None = None,
) -> Array:
    """Return the columns of an axis at the samples, shape (n, n_shared + 1 + n_terms).

    The torque of the axis's rotor, of known inertia, follows the shared columns.

    Parameters
    ----------
    rows : ndarray, shape (n, n_base)
        Columns of the base parameters.
    first : ndarray, shape (n_base,)
        First estimate of the base parameters, for the transmitted torque; a rough one suffices,
        since only a small term of friction depends on this torque.
    terms : sequence of str
        Terms of friction; ripple indistinguishable from gravity and inertia is 0 throughout.
    gears : ndarray, shape (n, n_joints, n_soft), optional
        Columns of `soft_gears`.
    """
    q, qd = motion.q, motion.qd
    offered = set(ripple_orders(robot, axis))
    hidden = {f"{wave} {n}" for wave in WAVES for n in RIPPLE_ORDERS if n not in offered}
    seen = [term for term in terms if term not in hidden]
    friction = np.zeros((len(q), len(terms)))
    if seen:
        friction[:, [terms.index(term) for term in seen]] = friction_columns(
            qd[:, axis] / motion.processing.speed[axis],
            motion.directions[axis],
            rows @ first,
            motor_angle(robot, q, axis),
            motor_angle(robot, qd, axis) / (2 * np.pi) * motion.period / SEEN,
            terms=seen,
        )
    # the torque of the rotor of an axis, of known inertia, shape (n,) [N m or N]
    rotor = motor_torque(robot, motion.q, motion.qd, motion.qdd)[:, axis]
    soft = q[:, :0] if gears is None else gears[:, axis]
    return side_by_side(rows, coupled_friction(robot, qd, axis), soft, rotor, friction)
