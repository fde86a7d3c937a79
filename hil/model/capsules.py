"""Capsule geometry of the links, for collision avoidance.

A capsule is a segment in the link's frame with a radius. A robot file may state it; otherwise the
segment leads from the link's own origin to that of the next joint (the first one in a tree), a last
link is a sphere about its origin, and the radius is `DEFAULT_RADIUS`. The default follows the
frames, not the castings: measure the links of a real robot, tools and cables included.

`reach` bounds the motion of a link per motion of a joint. With only joint j turning, no point of a
link's segment moves farther than its distance from that joint's axis times the angle, and the
distance is at most the sum of the lengths in between; turning the joints one after the other gives
the sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.model.robot import Robot


DEFAULT_RADIUS = 0.1
"""Default radius of a link's capsule [m]."""


@dataclass(frozen=True, eq=False)
class Capsules:
    """Capsules of the links.

    Attributes
    ----------
    ends : array (n_links, 2, 3)
        Ends of the segments, each in its link's frame [m].
    radii : array (n_links,)
        Radii [m].
    stated : tuple of bool
        True for capsules stated in the robot file.
    reach : array (n_links, n_joints)
        Largest distance moved by the segment's points per change of each joint [m/rad; 1 if
        prismatic].
    """

    ends: Array
    radii: Array
    stated: tuple[bool, ...]
    reach: Array


@lru_cache(maxsize=32)
def capsules(robot: Robot) -> Capsules:
    """Return the capsules of `robot`, stated in the robot file or assumed."""
    stated = [joint.capsule for joint in robot.file.joints]
    links = range(robot.n_joints)
    ends = np.array([_default(robot, i) if c is None else c.ends for i, c in enumerate(stated)])
    reach = np.array([[_reach(robot, ends[i], i, j) for j in links] for i in links])
    return Capsules(
        ends=ends,
        radii=np.array([DEFAULT_RADIUS if c is None else c.radius for c in stated]),
        stated=tuple(c is not None for c in stated),
        reach=reach,
    )


def link_reaches(robot: Robot) -> Array:
    """Compute the radius about the base origin that contains a link's capsule (n_links,) [m]."""
    shapes = capsules(robot)
    joints = [sum(_length(robot, k) for k in robot.path(link)) for link in range(robot.n_joints)]
    ends: Array = np.linalg.norm(shapes.ends, axis=-1).max(axis=-1)
    return np.array(joints) + ends + shapes.radii


def segments(robot: Robot, q: Array) -> Array:
    """Compute the ends of the links' segments in the base frame, shape (n, n_links, 2, 3) [m].

    Parameters
    ----------
    q : array (n, n_joints)
        Configurations [rad or m].
    """
    ends = capsules(robot).ends
    frames = {-1: (np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3)))}
    placed = np.empty((len(q), robot.n_joints, 2, 3))
    for link, parent in enumerate(robot.parents):
        rotation, origin = frames[parent]
        pose, about = robot.link_pose(link), q[:, link] + robot.theta[link]
        if robot.revolute[link]:
            origin = origin + rotation @ pose[:3, 3]
            x, y, z = np.moveaxis(rotation @ pose[:3, :3], -1, 0)
            c, s = np.cos(about)[:, None], np.sin(about)[:, None]
            rotation = np.stack([c * x + s * y, c * y - s * x, z], axis=-1)
        else:
            shift = pose[:3, 3] + q[:, link, None] * pose[:3, 2]
            origin = origin + np.einsum("nij,nj->ni", rotation, shift)
            rotation = rotation @ pose[:3, :3]
        frames[link] = rotation, origin
        placed[:, link] = origin[:, None] + ends[link] @ rotation.swapaxes(-1, -2)
    return placed


def _default(robot: Robot, link: int) -> Array:
    following = robot.next_link(link)
    if following is None:
        return np.zeros((2, 3))
    return np.array([[0.0, 0.0, 0.0], robot.link_pose(following)[:3, 3]])


def _reach(robot: Robot, ends: Array, link: int, joint: int) -> float:
    if joint not in (path := robot.path(link)):
        return 0.0
    if not robot.revolute[joint]:
        return 1.0
    if joint == link:
        return float(np.hypot(ends[:, 0], ends[:, 1]).max())
    following, *outer = path[path.index(joint) + 1 :]
    between = sum(_length(robot, k) for k in outer)
    along, beside = _offset(robot, following)
    first = float(np.hypot(along, beside * np.sin(robot.alpha[following])))
    return first + between + float(np.linalg.norm(ends, axis=1).max())


def _length(robot: Robot, joint: int) -> float:
    """Return the maximum distance of a frame's origin from the parent's [m]."""
    return float(np.hypot(*_offset(robot, joint))) + abs(float(robot.b[joint]))


def _offset(robot: Robot, joint: int) -> tuple[float, float]:
    """Return the maximum shifts along x and z between two frames [m]."""
    r = float(robot.r[joint])
    if robot.revolute[joint]:
        return float(robot.d[joint]), r
    return float(robot.d[joint]), max(abs(r + robot.q_min[joint]), abs(r + robot.q_max[joint]))
