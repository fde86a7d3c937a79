"""How motors turn for joints: the one place that knows where a robot states it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot


def motor_matrix(robot: Robot) -> NDArray[np.float64]:
    """R of q_motor = R q, shape (n_joints, n_joints) [rad per rad, or per m]."""
    return np.diag(robot.gear_ratio)
