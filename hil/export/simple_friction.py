"""Friction as simulators have it: Coulomb's and viscous friction, and what that leaves out.

A simulator knows a constant that opposes the motion and a share of the velocity. Of the law that
was identified they are the least-squares fit over all speeds up to the axis's own, both directions
alike, neither negative, where the rigid bodies load the axis with nothing; what asymmetry, the
curve at low speed and friction of the load are then off by is stated as the misfit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import nnls

from hil.estimation.friction_law import friction_torque

if TYPE_CHECKING:
    from hil.results.model import Model

SPEEDS = 50
"""Even steps of speed, in each direction."""


class SimpleFriction(NamedTuple):
    """Friction of one joint.

    Attributes
    ----------
    coulomb : float
        [N m or N].
    viscous : float
        [N m s/rad or N s/m].
    misfit : float
        Root mean square difference to the identified law up to `speed` [N m or N].
    speed : float
        [rad/s or m/s].
    """

    coulomb: float
    viscous: float
    misfit: float
    speed: float


def simple_friction(model: Model, axis: int) -> SimpleFriction | None:
    """Coulomb's and viscous friction of a joint (from 0); None where no law is known."""
    law = model.friction_law
    own = None if law is None else law.axes[axis]
    if law is None or own is None:
        return None
    steps = (np.arange(SPEEDS) + 0.5) / SPEEDS * own.speed
    qd = np.zeros((2 * SPEEDS, model.robot.n_joints))
    qd[:, axis] = np.concatenate([steps, -steps])
    still = np.zeros_like(qd)
    torque = friction_torque(model.robot, law, still, qd, still)[:, axis]
    columns = np.column_stack([np.sign(qd[:, axis]), qd[:, axis]])
    (coulomb, viscous), left = nnls(columns, torque)
    return SimpleFriction(
        float(coulomb), float(viscous), float(left) / np.sqrt(len(qd)), float(own.speed)
    )


def friction_remarks(model: Model) -> tuple[str, ...]:
    """What simple friction is off by, joint by joint, and of which joints none is known."""
    robot = model.robot
    found = [(axis, simple_friction(model, axis)) for axis in range(robot.n_joints)]
    off = [
        f"joint {axis + 1} {each.misfit:.2g} {robot.torque_unit(axis)} up to {each.speed:.3g}"
        f" {robot.position_unit(axis)}/s"
        for axis, each in found
        if each is not None
    ]
    unknown = ", ".join(str(axis + 1) for axis, each in found if each is None)
    remarks = []
    if off:
        remarks.append(
            "Coulomb's and viscous friction alone differ from the identified law, rms:"
            f" {'; '.join(off)}"
        )
    if unknown:
        remarks.append(
            f"no friction of joints {unknown} is known, so none is stated; identify the run anew,"
            " with recordings that show it"
        )
    return tuple(remarks)
