"""Frames in modified Denavit-Hartenberg notation from the axes of a chain.

Frame j has z along axis j and x along the common normal to axis j+1 (Khalil and Kleinfinger 1986),
so that four numbers determine frame j+1. Freedom in the notation is used to minimise the number of
lengths: frame 0 is frame 1 at q = 0, the last frame has neither rotation nor shift about z, and of
the common normals of parallel axes the one through the end of the previous normal is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.model.frames import QUARTER, ROUNDED_OFF, frame_pose, inverse, snap_angle

if TYPE_CHECKING:
    from hil.arrays import Array, Mask
    from hil.model.readers.urdf import UrdfChain
    from hil.model.robot_arrays import RobotArrays


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Frames of a chain.

    Attributes
    ----------
    alpha, d, theta, r : ndarray, shape (n_joints,)
        Parameters of the frames [rad], [m], [rad], [m].
    base : ndarray, shape (4, 4)
        Frame 0 in the base link.
    """

    alpha: Array
    d: Array
    theta: Array
    r: Array
    base: Array

    def poses(self, q: Array, revolute: Mask) -> Array:
        """Compute the frames in the base link, shape (n_joints, 4, 4)."""
        here, found = self.base, []
        theta, r = self.theta + q * revolute, self.r + q * ~revolute
        for each in zip(self.alpha, self.d, theta, r, strict=True):
            here = here @ frame_pose(*each)
            found.append(here)
        return np.array(found)


def find_frames(chain: UrdfChain) -> Frames:
    """Compute frames for the axes of a chain."""
    n = len(chain.joints)
    still = chain.frames(np.zeros(n))
    points = still[:, :3, 3]
    z = np.array([T[:3, :3] @ j.axis for T, j in zip(still, chain.joints, strict=True)])
    placed: list[Array] = []
    x = _any_normal(z[0])
    for j in range(n):
        origin = points[0] if not placed else _foot(placed[-1], points[j], z[j])
        if j + 1 < n:
            normal, meets = _common_normal(points[j], z[j], points[j + 1], z[j + 1], origin)
            if normal is not None:
                # take the smaller rotation; the length between the axes may be negative
                x, origin = (-normal if normal @ x < -ROUNDED_OFF else normal), meets
        else:
            x = placed[-1][:3, 0] if placed else x
        placed.append(_place_frame(origin, x, z[j]))
    base = placed[0]
    if n > 1:
        # the last frame has neither rotation nor shift about its own axis
        alpha, d, _, _ = _parameters(inverse(placed[-2]) @ placed[-1])
        placed[-1] = placed[-2] @ frame_pose(alpha, d, 0.0, 0.0)
    before = [base, *placed[:-1]]
    steps = [inverse(a) @ b for a, b in zip(before, placed, strict=True)]
    alpha, d, theta, r = np.array([_parameters(step) for step in steps]).T
    return Frames(alpha, d, theta, r, base)


def difference(chain: UrdfChain, robot: RobotArrays) -> str:
    """Describe the first difference of a chain from the robot, or return an empty string."""
    if not np.array_equal(chain.revolute, robot.revolute):
        return f"its joints are {', '.join(joint.type for joint in chain.joints)}"
    frames = find_frames(chain)
    for key in ("alpha", "d", "theta", "r"):
        found, stated = getattr(frames, key), getattr(robot, key)
        apart = np.abs(found - stated)
        if key in {"alpha", "theta"}:
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
