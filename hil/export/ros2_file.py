"""A model as parameters for ros2_control: a YAML file that controllers and nodes load as it is.

Two nodes of the file: `joint_dynamics`, read by whoever compensates gravity and friction, with one
list entry a joint under plain names, and `joint_limits` as joint_limits of ros2_control reads it.
The gravity torque itself needs the bodies: those of the URDF that the same model gives, or the code
that `--to c` writes.

The forms: control.ros.org, docs.ros.org (parameter files).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import yaml

from hil.export.exported import Exported
from hil.export.simple_friction import friction_of_joints, friction_remarks

if TYPE_CHECKING:
    from hil.export.simple_friction import SimpleFriction
    from hil.results.model import Model

NOTES = (
    "joint side, SI: N m, N m s/rad, kg m2; for prismatic joints N, N s/m, kg",
    "joints are named joint1 and on: rename them after your URDF, in the same order",
    "torque to command = rigid bodies + armature * acceleration + friction below; armature is the"
    " rotor inertia that the robot file states, one that was identified counts with the bodies",
    "static friction and the Stribeck velocity replace coulomb and viscous where your controller"
    " knows Stribeck's curve; do not add both",
    "over-compensated Coulomb friction makes a joint creep or oscillate: begin with half of it, and"
    " blend it in over a velocity a few times the noise of your velocity signal",
    "an effort interface takes these torques; with a current interface divide by torque_constant"
    " times gear_ratio",
)


def write_ros2(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the model as `NAME.ros2.yaml`."""
    robot, friction = model.robot, friction_of_joints(model)
    names = [f"joint{axis + 1}" for axis in range(robot.n_joints)]
    content = {
        "joint_dynamics": {
            "ros__parameters": {
                "joints": names,
                "gravity": [float(x) for x in robot.gravity],
                **{name: _dynamics(model, k, friction[k]) for k, name in enumerate(names)},
            }
        },
        "joint_limits": {
            "ros__parameters": {
                "joint_limits": {name: _limits(model, k) for k, name in enumerate(names)}
            }
        },
    }
    remarks = friction_remarks(model)
    head = "".join(f"# {line}\n" for line in (*origin, *NOTES, *remarks))
    text = head + yaml.safe_dump(content, sort_keys=False)
    return Exported({f"{robot.name}.ros2.yaml": text}, remarks)


def _dynamics(model: Model, axis: int, friction: SimpleFriction | None) -> dict[str, object]:
    robot = model.robot
    found: dict[str, object] = {"armature": float(robot.reflected_inertia[axis])}
    for key in ("gear_ratio", "torque_constant"):
        value = float(getattr(robot, key)[axis])
        if np.isfinite(value):
            found[key] = value
    if friction is not None:
        found["friction"] = {
            "coulomb": friction.coulomb,
            "viscous": friction.viscous,
            "misfit_rms": friction.misfit,
            "stribeck": {
                "coulomb": friction.stribeck.coulomb,
                "static": friction.stribeck.static,
                "viscous": friction.stribeck.viscous,
                "velocity": friction.stribeck.velocity,
            },
        }
    return found


def _limits(model: Model, axis: int) -> dict[str, object]:
    """Limits of one joint under the names of ros2_control; unknown ones are said to be none."""
    robot = model.robot
    found: dict[str, object] = {
        "has_position_limits": True,
        "min_position": float(robot.q_min[axis]),
        "max_position": float(robot.q_max[axis]),
    }
    for name, values in (
        ("velocity", robot.velocity_limit),
        ("acceleration", robot.acceleration_limit),
        ("effort", robot.torque_limit),
    ):
        known = bool(np.isfinite(values[axis]))
        found[f"has_{name}_limits"] = known
        if known:
            found[f"max_{name}"] = float(values[axis])
    return found
