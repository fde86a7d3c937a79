"""Where the frame of a link stands in that of the link before, while the joint between rests."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.frames import pose_of
from hil.model.polynomial import Polynomial

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.model.robot import Robot


def link_pose(robot: Robot, joint: int) -> Array:
    """Pose of frame j in frame j-1 at q_j + theta_j = 0 (revolute) or q_j = 0 (prismatic)."""
    return _link_pose(robot, joint, robot.d[joint], robot.r[joint])


def symbolic_link_pose(robot: Robot, joint: int) -> NDArray[np.object_]:
    """`link_pose` with entries that are polynomials in the lengths' names."""
    pose = _link_pose(robot, joint, robot.d_expressions[joint], robot.r_expressions[joint])
    lifted = [x if isinstance(x, Polynomial) else Polynomial.constant(x) for x in pose.flat]
    return np.array(lifted, dtype=object).reshape(4, 4)


def zero_pose(robot: Robot, joint: int) -> Array:
    """Pose of frame j in frame j-1 at q_j = 0, shape (4, 4)."""
    return pose_of(robot.alpha[joint], robot.d[joint], robot.theta[joint], robot.r[joint])


def _link_pose(robot: Robot, joint: int, d: Any, r: Any) -> NDArray[Any]:
    theta = 0.0 if robot.revolute[joint] else robot.theta[joint]
    return pose_of(robot.alpha[joint], d, theta, r)
