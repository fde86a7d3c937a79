"""Frames in modified Denavit-Hartenberg notation from the axes of a chain or tree.

Frame j has z along axis j and x along the common normal to axis j+1 (Khalil and Kleinfinger 1986),
so that four numbers determine frame j+1. Frames of other joints on the same link start with a
rotation gamma and shift b about z, to the common normal with their axis. Freedom in the notation is
used to minimise the number of lengths: frame 0 is frame 1 at q = 0, the last frame has neither
rotation nor shift about z, and of the common normals of parallel axes the one through the end of
the previous normal is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.model.frames import QUARTER, ROUNDED_OFF, frame_pose, inverse, snap_angle
from hil.model.readers.urdf import ROUNDED

if TYPE_CHECKING:
    from hil.arrays import Array, Mask
    from hil.model.readers.urdf import UrdfChain
    from hil.model.robot_arrays import RobotArrays


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Frames of a chain or tree.

    Attributes
    ----------
    alpha, d, theta, r, gamma, b : ndarray, shape (n_joints,)
        Parameters of the frames; angles [rad] and lengths [m] in turn.
    parents : tuple of int
        Joints that carry each joint, from 0; -1 for the base.
    base : ndarray, shape (4, 4)
        Frame 0 in the base link.
    """

    alpha: Array
    d: Array
    theta: Array
    r: Array
    gamma: Array
    b: Array
    parents: tuple[int, ...]
    base: Array

    def poses(self, q: Array, revolute: Mask) -> Array:
        """Compute the frames in the base link, shape (n_joints, 4, 4)."""
        found: list[Array] = []
        theta, r = self.theta + q * revolute, self.r + q * ~revolute
        steps = zip(self.alpha, self.d, theta, r, self.gamma, self.b, strict=True)
        for parent, step in zip(self.parents, steps, strict=True):
            found.append((self.base if parent < 0 else found[parent]) @ frame_pose(*step))
        return np.array(found)


def find_frames(chain: UrdfChain) -> Frames:
    """Compute frames for the axes of a chain or tree."""
    n, parents = len(chain.joints), chain.parents
    # the joint that the x axis of each link leads to
    ahead = {parent: j for j, parent in reversed([*enumerate(parents)])}
    still = chain.frames(np.zeros(n))
    points = still[:, :3, 3]
    z = np.array([T[:3, :3] @ j.axis for T, j in zip(still, chain.joints, strict=True)])
    # the common normal of axes that rounding has made nearly parallel is up to kilometres away
    for j, parent in enumerate(parents):
        if parent >= 0 and np.linalg.norm(np.cross(z[parent], z[j])) < ROUNDED:
            z[j] = math.copysign(1.0, z[parent] @ z[j]) * z[parent]
    directions: list[Array] = []
    placed: list[Array] = []
    steps = []
    for j, parent in enumerate(parents):
        before = placed[max(parent, 0)] if placed else None  # frame 0 is frame 1
        x = _any_normal(z[0]) if before is None else directions[max(parent, 0)]
        about_z = 0.0, 0.0
        if before is not None and j != ahead[parent]:
            about_z = _start(
                before[:3, :3].T @ (points[j] - before[:3, 3]), before[:3, :3].T @ z[j]
            )
            before = before @ frame_pose(0.0, 0.0, *about_z)
            x = before[:3, 0]
        origin = points[0] if before is None else _foot(before, points[j], z[j])
        if (k := ahead.get(j)) is not None:
            normal, meets = _common_normal(points[j], z[j], points[k], z[k], origin)
            if normal is not None:
                # take the smaller rotation; the length between the axes may be negative
                x, origin = (-normal if normal @ x < -ROUNDED_OFF else normal), meets
        elif before is not None:
            x = before[:3, 0]
        frame = _place_frame(origin, x, z[j])
        step = inverse(frame if before is None else before) @ frame
        if k is None and before is not None:
            # the last frame has neither rotation nor shift about the joint's axis
            frame = before @ frame_pose(*_parameters(step)[:2], 0.0, 0.0)
            step = inverse(before) @ frame
        directions.append(x)
        placed.append(frame)
        steps.append((*_parameters(step), *about_z))
    alpha, d, theta, r, gamma, b = np.array(steps).T
    return Frames(alpha, d, theta, r, gamma, b, parents, placed[0])


def difference(chain: UrdfChain, robot: RobotArrays) -> str:
    """Describe the first difference of a chain from the robot, or return an empty string."""
    if not np.array_equal(chain.revolute, robot.revolute):
        return f"its joints are {', '.join(joint.type for joint in chain.joints)}"
    if chain.parents != robot.parents:
        return "its joints branch in another way"
    frames = find_frames(chain)
    for key in ("alpha", "d", "theta", "r", "gamma", "b"):
        found, stated = getattr(frames, key), getattr(robot, key)
        apart = np.abs(found - stated)
        if key in {"alpha", "theta", "gamma"}:
            apart = np.minimum(apart % math.tau, -apart % math.tau)
        worst = int(np.argmax(apart))
        # tolerance 1e-6 [rad, m]
        if apart[worst] > 1e-6:
            return (
                f"{key} of joint {worst + 1} is {found[worst]:.6g}, of the model"
                f" {stated[worst]:.6g}"
            )
    return ""


def _common_normal(
    p: Array, z: Array, other: Array, other_z: Array, origin: Array
) -> tuple[Array | None, Array]:
    """Compute the direction of the common normal of two axes, and the foot point on the first.

    The direction is None for coincident axes.
    """
    between = np.cross(z, other_z)
    sine = float(np.linalg.norm(between))
    if sine < ROUNDED_OFF:
        apart = other - origin
        apart = apart - z * (apart @ z)
        length = float(np.linalg.norm(apart))
        return (apart / length if length > ROUNDED_OFF else None), origin
    normal = between / sine
    apart = other - p
    along = float(np.cross(apart, other_z) @ between) / sine**2
    return normal, p + along * z


def _foot(frame: Array, p: Array, z: Array) -> Array:
    """Compute the point of the line through `p` along `z` closest to the x axis of `frame`."""
    direction = frame[:3, 0]
    across = np.cross(direction, z)
    square = float(across @ across)
    if square < ROUNDED_OFF**2:
        return p
    along = float(np.cross(frame[:3, 3] - p, direction) @ -across) / square
    return p + along * z


def _place_frame(origin: Array, x: Array, z: Array) -> Array:
    x = x - z * (x @ z)
    x = x / np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    frame[:3, 3] = origin
    return frame


def _parameters(step: Array) -> tuple[float, float, float, float]:
    """Return alpha, d, theta, r of a frame in the previous frame."""
    alpha = float(np.arctan2(-step[1, 2], step[2, 2]))
    theta = float(np.arctan2(-step[0, 1], step[0, 0]))
    r = float(step[2, 3] * np.cos(alpha) - step[1, 3] * np.sin(alpha))
    d, r = _clean_length(float(step[0, 3])), _clean_length(r)
    return _clean_angle(alpha), d, _clean_angle(theta), r


def _start(p: Array, z: Array) -> tuple[float, float]:
    """Return gamma and b from x to the common normal of z and of the axis through `p` along `z`."""
    sine = float(np.hypot(z[0], z[1]))
    if sine < ROUNDED_OFF:
        apart = float(np.hypot(p[0], p[1]))
        return _clean_angle(float(np.arctan2(p[1], p[0])) if apart > ROUNDED_OFF else 0.0), 0.0
    gamma = float(np.arctan2(z[0], -z[1]))
    if abs(gamma) > QUARTER + ROUNDED_OFF:  # the smaller rotation, as for the normal of a chain
        gamma -= math.copysign(2 * QUARTER, gamma)
    along = float(p[:2] @ z[:2]) / sine**2
    return _clean_angle(gamma), _clean_length(float(p[2] - along * z[2]))


def _clean_angle(angle: float) -> float:
    exact = snap_angle(angle, ROUNDED_OFF)
    return QUARTER * 2 if exact == -QUARTER * 2 else exact + 0.0


def _clean_length(length: float) -> float:
    return round(length, 12) + 0.0


def _any_normal(z: Array) -> Array:
    """Return a unit vector perpendicular to z."""
    unit = np.eye(3)[int(np.argmin(np.abs(z)))]
    normal = unit - z * (unit @ z)
    return np.asarray(normal / np.linalg.norm(normal))
