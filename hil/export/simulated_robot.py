"""Robot for simulators: tree of bodies, with limits, rotors and friction of each joint.

Bodies are those of `Model.consistent`. Frames are those of the robot file (z of frame j is the axis
of joint j), or those of a URDF of the same chain, with the names of the URDF.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.export.simple_friction import friction_of_joints
from hil.model.added_parameters import added_inertias
from hil.model.frames import inverse, parameter_map, pseudo_inertia
from hil.model.readers.axes_to_frames import find_frames

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.arrays import Array
    from hil.export.simple_friction import SimpleFriction
    from hil.model.readers.urdf import UrdfChain
    from hil.model.robot import Robot
    from hil.results.model import Model


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedJoint:
    """Joint and its link.

    Attributes
    ----------
    parent : int
        Index of the joint that carries this one; -1 for the base.
    before : ndarray, shape (4, 4)
        Pose of the link's frame in the parent's frame, at q = 0.
    axis : ndarray, shape (3,)
        Axis in the link's frame.
    lower, upper, velocity, effort : float
        Limits; NaN where unknown [rad, rad/s, N m, or m, m/s, N].
    armature : float
        Rotor's inertia on the joint's side [kg m^2 or kg].
    friction : SimpleFriction, optional
    stiffness : float
        Stiffness of a linear spring [N m/rad or N/m].
    body : ndarray, shape (10,)
        Standard parameters in the link's frame.
    """

    name: str
    link: str
    parent: int
    revolute: bool
    before: Array
    axis: Array
    lower: float
    upper: float
    velocity: float
    effort: float
    armature: float
    friction: SimpleFriction | None
    stiffness: float
    body: Array

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return float(self.body[9])

    @property
    def centre(self) -> Array:
        """Centre of mass in the link's frame, shape (3,) [m]."""
        return np.asarray(self.body[6:9] / self.body[9])

    @property
    def inertia(self) -> Array:
        """Inertia about the centre of mass along the link's axes, shape (3, 3) [kg m^2]."""
        return about_centre(self.body)


def about_centre(body: Array) -> Array:
    """Return the inertia of a body (10,) about its centre of mass, shape (3, 3) [kg m^2]."""
    J = pseudo_inertia(body)
    spread = J[:3, :3] - np.outer(J[:3, 3], J[:3, 3]) / J[3, 3]
    return np.asarray(np.trace(spread) * np.eye(3) - spread)


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRobot:
    """Chain or tree of joints.

    Attributes
    ----------
    name, base : str
        Names of the robot and of its first link, which is at rest.
    gravity : ndarray, shape (3,)
        Gravity in the base link [m/s^2].
    rotors : ndarray, shape (n_joints, n_joints)
        Motors' share of the mass matrix, with off-diagonal elements for motors that turn with two
        joints.
    """

    name: str
    base: str
    gravity: Array
    joints: tuple[SimulatedJoint, ...]
    rotors: Array

    @property
    def coupled(self) -> bool:
        """True if a motor turns with two joints."""
        return bool(np.any(self.rotors - np.diag(np.diag(self.rotors))))


def simulated_robot(model: Model, chain: UrdfChain | None = None) -> SimulatedRobot:
    """Return a model in the form that simulators use.

    Parameters
    ----------
    model : Model
        Model with bodies.
    chain : UrdfChain, optional
        Chain of the same robot, for frames and names.
    """
    robot, consistent = model.robot, model.consistent
    if consistent is None:
        raise ValueError(
            "the model has no physically consistent links; run find_consistent_robot first"
        )
    friction = friction_of_joints(model)
    added = np.array([consistent.added[name] for name in robot.added_parameters])
    rotors = np.diag(robot.reflected_inertia) + np.tensordot(added, added_inertias(robot), 1)
    return SimulatedRobot(
        name=robot.name if chain is None else chain.robot,
        base="base" if chain is None else chain.base,
        gravity=robot.gravity if chain is None else find_frames(chain).base[:3, :3] @ robot.gravity,
        joints=tuple(
            SimulatedJoint(
                name=each.name,
                link=each.link,
                parent=robot.parents[axis],
                revolute=bool(robot.revolute[axis]),
                before=each.before,
                axis=each.axis,
                lower=float(robot.q_min[axis]),
                upper=float(robot.q_max[axis]),
                velocity=float(robot.velocity_limit[axis]),
                effort=float(robot.torque_limit[axis]),
                armature=float(rotors[axis, axis]),
                friction=friction[axis],
                stiffness=consistent.added.get(f"k{axis + 1}", 0.0),
                body=parameter_map(each.mdh) @ consistent.bodies[axis],
            )
            for axis, each in enumerate(placed(robot, chain))
        ),
        rotors=rotors,
    )


def moved_to_frames(chain: UrdfChain, robot: Robot, bodies: Sequence[Array]) -> Array:
    """Return bodies of links, transformed to the frames of the robot file: (n_joints, 10)."""
    pairs = zip(placed(robot, chain), bodies, strict=True)
    return np.array([parameter_map(inverse(each.mdh)) @ body for each, body in pairs])


class JointPlace(NamedTuple):
    """Names and place of a joint; `mdh`: the robot file's frame in the link's frame."""

    name: str
    link: str
    before: Array
    axis: Array
    mdh: Array


def placed(robot: Robot, chain: UrdfChain | None) -> list[JointPlace]:
    """Return the joints as placed by the robot file or a URDF."""
    if chain is None:
        z, same = np.array([0.0, 0.0, 1.0]), np.eye(4)
        poses = (robot.zero_pose(j) for j in range(robot.n_joints))
        return [
            JointPlace(f"joint{j}", f"link{j}", T, z, same) for j, T in enumerate(poses, start=1)
        ]
    still = np.zeros(robot.n_joints)
    frames = find_frames(chain).poses(still, robot.revolute)
    return [
        JointPlace(joint.name, joint.link, joint.before, joint.axis, inverse(own) @ mdh)
        for joint, own, mdh in zip(chain.joints, chain.frames(still), frames, strict=True)
    ]


def number(value: float) -> str:
    """Return the shortest text for a number that restores the same double."""
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: Iterable[float]) -> str:
    """Return numbers separated by spaces."""
    return " ".join(number(float(value)) for value in values)


def roll_pitch_yaw(rotation: Array) -> Array:
    """Return the angles about the fixed x, y and z axes, shape (3,) [rad].

    Yaw is zero if the x axis is vertical, where only the sum of roll and yaw is defined.
    """
    across = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = np.arctan2(-rotation[2, 0], across)
    if across < 1e-12:
        return np.array([np.arctan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0])
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    return np.array([roll, pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


def comment(lines: Sequence[str]) -> str:
    """Return lines for an XML comment, without two hyphens in a row."""
    safe = (line.replace("-", "- ") if "--" in line else line for line in lines)
    return "\n" + "".join(f"  {line}\n" for line in safe)
