"""Likely bodies of links by shape, for combinations of parameters that data do not determine.

Torques show only combinations of the links' parameters; the rest is chosen nearest to likely
bodies. Bodies stated in a URDF take precedence. Otherwise a link is a rod with rounded ends: the
capsule in the robot file, or the line from its frame to the next one; its mass is proportional to
its volume. The common scale of mass and size is left to the data
(`hil.estimation.consistent.nearest`); here all links have the density of water.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.frames import body_parameters
from hil.planning.prediction.precision import whole_range

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.model.robot import Robot


SLENDERNESS, STOUTEST = 0.25, 0.1
"""Radius of a link over its length, and minimum radius over the robot's length."""
SHORTEST = 0.3
"""Minimum length of a robot [m], used where all axes meet."""


def likely_bodies(robot: Robot) -> Array:
    """Return the standard parameters of the links' likely bodies, shape (n_joints, 10)."""
    shapes = (ends_and_radius(robot, link) for link in range(robot.n_joints))
    return np.array([_rod(*shape) for shape in shapes])


def sized_bodies(robot: Robot) -> Array:
    """Return base parameters of the heaviest likely bodies that the drives can move, (n_base,).

    On motions through the full ranges, speeds and accelerations the most loaded axis just reaches
    its torque limit.
    """
    base = base_parameters(robot)
    present = [name in robot.present for name in robot.standard_parameters]
    p = base.matrix @ (likely_bodies(robot).ravel() * present)
    most = np.abs(inverse_dynamics(robot, p, *whole_range(robot))).max(axis=0)
    sized: Array = p / (most / robot.torque_limit).max()
    return sized


def ends_and_radius(robot: Robot, link: int) -> tuple[Array, Array, float]:
    """Return ends and radius of a link (from 0) as a capsule in the link's frame [m]."""
    stated = robot.file.joints[link].capsule
    if stated is not None:
        return np.array(stated.ends[0]), np.array(stated.ends[1]), stated.radius
    reach = reach_of(robot)
    end = np.array([0.0, 0.0, 0.1 * reach])
    if (following := robot.next_link(link)) is not None:
        pose = robot.link_pose(following)
        middle = 0.0 if robot.revolute[following] else (robot.q_min + robot.q_max)[following] / 2
        end = pose[:3, 3] + middle * pose[:3, 2]
    length = float(np.linalg.norm(end))
    return np.zeros(3), end, max(SLENDERNESS * length, STOUTEST * reach)


def reach_of(robot: Robot) -> float:
    """Return the length of the stretched robot, at least `SHORTEST` [m]."""
    slides = np.where(robot.revolute, 0.0, np.maximum(np.abs(robot.q_min), np.abs(robot.q_max)))
    lengths = np.hypot(robot.d, robot.r) + slides + np.abs(robot.b)
    reaches = (float(np.sum(lengths[list(robot.path(link))])) for link in robot.last_links)
    return max(*reaches, SHORTEST)


def _rod(begin: Array, end: Array, radius: float) -> Array:
    """Return the standard parameters of a rod with rounded ends."""
    along, centre = end - begin, (begin + end) / 2
    # density of all links [kg/m^3]
    mass = 1000.0 * np.pi * radius**2 * (np.linalg.norm(along) + 4 * radius / 3)
    spread = np.outer(along, along) / 12 + radius**2 / 4 * np.eye(3)
    body = np.ones((4, 4))
    body[:3, :3] = spread + np.outer(centre, centre)
    body[:3, 3] = body[3, :3] = centre
    return np.array(body_parameters(mass * body))
