"""Known inertia of the motors, eq. (7) of Grotjahn et al. (2001), to be compensated.

A drive train is described by gear ratio N and rotor inertia Im alone. Each motor then turns N times
as fast as its own joint and with no other joint, so that H is diagonal and constant, N^2 Im, and
c_m vanishes. Gyroscopic torques by the motion of the carrying links, smaller by a factor N, are
neglected; the motors' masses belong to the links. Inertias unknown in the robot file are identified
instead (`hil.model.added_parameters`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.model.robot import Robot


def motor_inertia(robot: Robot, q: ArrayLike) -> Array:
    """Compute H(q) of eq. (7), shape (n_samples, n_joints, n_joints); 2-D for a single q.

    Joint side: kg m^2 for revolute joints, kg for prismatic ones.
    """
    q = np.asarray(q, dtype=np.float64)
    reflected = np.diag(robot.reflected_inertia)
    return np.broadcast_to(reflected, (*q.shape[:-1], *reflected.shape)).copy()


def motor_torque(robot: Robot, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
    """Compute H(q) qdd + c_m(q, qd) of eq. (7), shape of `qdd` [N m].

    Examples
    --------
    >>> robot = hil.Robot.load("manutec-r15")
    >>> hil.motor_torque(robot, np.zeros((100, 6)), 0.5, np.zeros((100, 6))).shape
    (100, 6)
    """
    del q, qd  # H is constant and diagonal and c_m vanishes, see the module
    return robot.reflected_inertia * np.asarray(qdd, dtype=np.float64)
