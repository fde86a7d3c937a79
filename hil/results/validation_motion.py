"""A free motion of all joints at once, made to be unlike any measurement.

What a model is worth shows on a motion that it was not fitted to. This one is a finite Fourier
series for each joint, with seeded coefficients, scaled until position, velocity and acceleration
all stay within a share of the robot's limits. It is calculated with, never driven.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from hil.model.robot import Robot

    Array = NDArray[np.float64]

HARMONICS = 5
PERIOD = 10.0
"""Of the fundamental [s]."""
SAMPLES = 2000
SHARE = 0.9
"""Of each limit that the motion uses at most."""


@dataclass(frozen=True, slots=True, eq=False)
class ValidationMotion:
    """Positions, velocities, accelerations, each of shape (n, n_joints) [rad, rad/s, rad/s^2]."""

    q: Array
    qd: Array
    qdd: Array


def free_motion(robot: Robot, seed: int = 0, speed: ArrayLike | None = None) -> ValidationMotion:
    """One period of a random motion within the limits of `robot`; the same seed, the same motion.

    Joints are scaled one by one, so each of them is as fast as the tightest of its limits allows.

    Parameters
    ----------
    robot : Robot
        Limits that are unknown (NaN) do not limit.
    seed : int
    speed : array_like, shape (n_joints,), optional
        That counts where the limit of the velocity is unknown [rad/s or m/s].
    """
    rng = np.random.default_rng(seed)
    order = 2 * np.pi / PERIOD * np.arange(1, HARMONICS + 1)
    phase = np.outer(np.arange(SAMPLES) * PERIOD / SAMPLES, order)
    a, b = rng.standard_normal((2, HARMONICS, robot.n_joints)) / order[:, np.newaxis]
    waves = ValidationMotion(
        q=np.sin(phase) @ a - np.cos(phase) @ b,
        qd=(np.cos(phase) * order) @ a + (np.sin(phase) * order) @ b,
        qdd=(-np.sin(phase) * order**2) @ a + (np.cos(phase) * order**2) @ b,
    )
    middle, reach = (robot.q_max + robot.q_min) / 2, (robot.q_max - robot.q_min) / 2
    velocity = robot.velocity_limit
    if speed is not None:
        velocity = np.where(np.isfinite(velocity), velocity, speed)
    shares = [
        np.abs(waves.q).max(axis=0) / reach,
        np.abs(waves.qd).max(axis=0) / velocity,
        np.abs(waves.qdd).max(axis=0) / robot.acceleration_limit,
    ]
    scale = SHARE / np.fmax.reduce(shares)
    middle = np.nan_to_num(middle)
    return ValidationMotion(middle + scale * waves.q, scale * waves.qd, scale * waves.qdd)
