"""Links for a robot with known frames and limits: real bodies with the largest possible mass.

A robot file says which link parameters exist, not their values. So each link becomes a body of six
points, stretched from its own frame towards the next frame and off the axes, so that no parameter
called present by the file is zero. From the last link inwards each link is made as heavy as its
joint can bear: gravity and the acceleration of plans together take `SHARE` of the torque limit.
Parameters omitted by the file are zero, tied ones equal.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim_plant.physics.reflected_inertia import (
    NotPositive,
    configurations,
    gravity_torques,
    mass_matrix,
    reflected_inertia,
)
from sim_plant.twin.robot import LINK_PARAMETERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sim_plant.physics.reflected_inertia import Arm
    from sim_plant.twin.robot import RobotDescription

    Array = NDArray[np.float64]

SHARE = 0.5
"""Share of the torque limit taken by the links."""
ACCELERATION = 0.6
"""Share of the acceleration limit used by plans."""
HEAVIER = 2.5
"""Maximum mass of a link, in masses of all links beyond it."""
_TRIED = 200
_OFF_AXIS = np.array([[0.8, -0.5, 0.33], [-0.46, 0.7, 0.55], [0.5, 0.62, -0.6]])
"""Directions of the centres of mass off the line from frame to frame, in turn."""
_INERTIAS = {
    "Ixx": (0, 0),
    "Iyy": (1, 1),
    "Izz": (2, 2),
    "Ixy": (0, 1),
    "Ixz": (0, 2),
    "Iyz": (1, 2),
}


class NoLinks(ValueError):
    """Failure to find bodies for the links."""


def arm_of(robot: RobotDescription, bodies: Array) -> Arm:
    """Return a robot with the given bodies, shape (n, 10), for the compiled dynamics."""
    alpha, d, theta, r = np.array(robot.frames()).T
    cos, sin = np.cos(alpha), np.sin(alpha)
    frames = np.column_stack([cos, sin, d, -sin * r, cos * r])
    slides = [float(joint.type == "prismatic") for joint in robot.joints]
    kinds = np.column_stack([slides, theta])
    return tuple(range(len(alpha))), frames, bodies, np.array(robot.gravity), kinds


def reach_of(robot: RobotDescription) -> Array:
    """Return the ranges of the joints, shape (n, 2) [rad or m]."""
    return np.array([(joint.q_min, joint.q_max) for joint in robot.joints])


def motors_of(robot: RobotDescription) -> Array:
    """Return the rotor inertias at the joints, shape (n,) [kg m^2 or kg]."""
    return np.array([joint.motor_inertia for joint in robot.joints])


def draft_bodies(robot: RobotDescription) -> Array:
    """Draft bodies of all links, shape (n, 10), in the order of `LINK_PARAMETERS`.

    Raises
    ------
    NoLinks
        The parameters that the robot file calls present belong to no machine.
    """
    shapes = _shapes(robot)
    for _ in range(12):
        bodies = _masses(robot, shapes)[:, np.newaxis] * shapes
        try:
            reflected_inertia(arm_of(robot, bodies), motors_of(robot), reach_of(robot))
        except NotPositive:
            shapes = _rounder(shapes)
        else:
            return bodies
    raise NoLinks(
        "no masses make M(q) positive definite with the link parameters that are present; state"
        " more parameters, or a rotor_inertia for each joint"
    )


def _shapes(robot: RobotDescription) -> Array:
    """Return bodies of 1 kg."""
    spans = _spans(robot)
    lengths = np.linalg.norm(spans, axis=1)
    usual = float(np.median(lengths[lengths > 0.02])) if (lengths > 0.02).any() else 0.3
    shapes = [_shape(span, usual, number) for number, span in enumerate(spans)]
    for joint, shape in zip(robot.joints, shapes, strict=True):
        shape[[name not in joint.parameters for name in LINK_PARAMETERS]] = 0.0
    found = np.array(shapes)
    for tied, value in robot.tied():
        found[tied] = found[value]
    return found


def _spans(robot: RobotDescription) -> Array:
    """Return the vectors from frame to next frame with joints in mid-range, shape (n, 3)."""
    bodies = np.zeros((len(robot.joints), len(LINK_PARAMETERS)))
    _, frames, _, _, kinds = arm_of(robot, bodies)
    assert kinds is not None  # noqa: S101 - `arm_of` always gives some
    slid = kinds[:, 0] * reach_of(robot).mean(axis=1)
    along = np.column_stack([np.zeros(len(slid)), -frames[:, 1], frames[:, 0]])
    origins = frames[:, 2:5] + slid[:, np.newaxis] * along
    return np.vstack([origins[1:], np.zeros(3)])


def _shape(span: Array, usual: float, number: int) -> Array:
    """Return a body of six points, 1 kg in total, between two frames and off their line."""
    side = _OFF_AXIS[number % len(_OFF_AXIS)]
    length = float(np.linalg.norm(span))
    first = span / length if length > 0.02 else side / np.linalg.norm(side)
    second = np.cross(first, np.roll(side, 1))
    second /= np.linalg.norm(second)
    third = np.cross(first, second)
    off = 0.25 if length > 0.02 else 0.4
    centre = 0.45 * span + off * usual * side
    half = np.array([max(0.5 * length, 0.3 * usual), 0.3 * usual, 0.2 * usual])
    ways = half[:, np.newaxis] * np.array([first, second, third])
    points = centre + np.vstack([ways, -ways])
    second_moment = points.T @ points / len(points)
    inertia = np.trace(second_moment) * np.eye(3) - second_moment
    return np.array([1.0, *centre, *(inertia[_INERTIAS[name]] for name in LINK_PARAMETERS[4:])])


def _rounder(shapes: Array) -> Array:
    """Return bodies with first moments and products of inertia reduced by 30 %."""
    rounder = shapes.copy()
    rounder[:, [1, 2, 3, 7, 8, 9]] *= 0.7
    return rounder


def _masses(robot: RobotDescription, shapes: Array) -> Array:
    """Return the masses permitted by the torque limits, shape (n,) [kg]."""
    per_mass = _demand(robot, shapes)
    most = SHARE * np.array([joint.torque_limit for joint in robot.joints])
    n = len(most)
    masses = np.zeros(n)
    for link in range(n - 1, -1, -1):
        outer, own = per_mass[link, link + 1 :] @ masses[link + 1 :], per_mass[link, link]
        carried = masses[link + 1 :].sum()
        bearable = max(most[link] - outer, 0.0) / own if own > 0 else carried
        masses[link] = min(bearable, HEAVIER * carried) if carried > 0 else bearable
        masses[link] = max(masses[link], 0.3 * carried)
        loaded = per_mass[link, link:] @ masses[link:]
        if loaded > most[link]:
            masses[link:] *= most[link] / loaded
    return masses


def _demand(robot: RobotDescription, shapes: Array) -> Array:
    """Return the maximum torque at all axes per kg of every link, shape (n, n) [N m or N].

    Any one axis accelerates; the others are to hold still.
    """
    n = len(shapes)
    accelerations = ACCELERATION * np.array([joint.acceleration_limit for joint in robot.joints])
    tried = configurations(reach_of(robot), _TRIED)
    found = np.zeros((n, n))
    for link in range(n):
        alone = np.zeros_like(shapes)
        alone[link] = shapes[link]
        arm = arm_of(robot, alone)
        gravity = np.abs([gravity_torques(arm, q) for q in tried]).max(axis=0)
        inertia = np.max([np.abs(mass_matrix(arm, q)) * accelerations for q in tried], axis=(0, 2))
        found[:, link] = gravity + inertia
    return found
