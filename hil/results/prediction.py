"""Uncertainty of parameters in terms of torques: accuracy of the model on an unseen motion.

A parameter's standard error says little without context: 0.01 kg m^2 is nothing at the first axis
and much at the last. The regressor of a free motion of the robot, tau = A p, converts the
covariance to A C A', which makes all errors comparable. The motion is unlike any measurement: a
finite Fourier series for each joint, with seeded coefficients, scaled until position, velocity and
acceleration stay within a share of the robot's limits. The motion is used for calculations only,
never driven.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.result import FreeMotionFit
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.results.identified_robot import IdentifiedRobot


def free_motion(
    robot: Robot, seed: int = 0, speed: ArrayLike | None = None
) -> tuple[Array, Array, Array]:
    """Return one period of a random motion within the limits of `robot`, determined by the seed.

    Joints are scaled separately, so each is as fast as 0.9 of the tightest of its limits allows.

    Parameters
    ----------
    robot : Robot
        Robot with limits; unknown limits (NaN) do not limit.
    speed : array_like, shape (n_joints,), optional
        Speed in place of an unknown velocity limit [rad/s or m/s].

    Returns
    -------
    q, qd, qdd : ndarray, shape (2000, n_joints)
        Five harmonics of 10 s [rad, rad/s, rad/s^2], for prismatic joints [m, m/s, m/s^2].
    """
    rng, harmonics, period, samples = np.random.default_rng(seed), 5, 10.0, 2000
    order = 2 * np.pi / period * np.arange(1, harmonics + 1)
    phase = np.outer(np.arange(samples) * period / samples, order)
    a, b = rng.standard_normal((2, harmonics, robot.n_joints)) / order[:, np.newaxis]
    q = np.sin(phase) @ a - np.cos(phase) @ b
    qd = (np.cos(phase) * order) @ a + (np.sin(phase) * order) @ b
    qdd = (-np.sin(phase) * order**2) @ a + (np.cos(phase) * order**2) @ b
    middle, reach = (robot.q_max + robot.q_min) / 2, (robot.q_max - robot.q_min) / 2
    velocity = robot.velocity_limit
    if speed is not None:
        velocity = np.where(np.isfinite(velocity), velocity, speed)
    shares = [
        np.abs(q).max(axis=0) / reach,
        np.abs(qd).max(axis=0) / velocity,
        np.abs(qdd).max(axis=0) / robot.acceleration_limit,
    ]
    scale = 0.9 / np.fmax.reduce(shares)
    return np.nan_to_num(middle) + scale * q, scale * qd, scale * qdd


class FreeTorques:
    """Root mean squares of the rigid-body torques on a free motion, for any base parameters.

    `speed` replaces unknown limits of the robot (`free_motion`).
    """

    def __init__(self, robot: Robot, speed: ArrayLike | None = None) -> None:
        motion = free_motion(robot, speed=speed)
        self._robot, self._q, self._A = robot, motion[0], regressor(robot, *motion)

    def rms(self, p: Array) -> Array:
        """Return the torque of base parameters or of their change, shape (n_joints,) [N m or N]."""
        torques: Array = np.sqrt(np.mean((self._A @ p) ** 2, axis=0))
        return torques

    def parameter_torques(self, p: Array) -> Array:
        """Return the torque of each base parameter alone, shape (n_joints, n_base) [N m or N]."""
        torques: Array = np.sqrt(np.mean(self._A**2, axis=0)) * p
        return torques

    def standard_error(self, covariance: Array, *, gravity: bool = False) -> Array:
        """Return the torque's standard error by a covariance of p, shape (n_joints,) [N m or N].

        With `gravity` the torque is that of gravity alone, at a tenth of the configurations.
        """
        A = self._A
        if gravity:
            q = self._q[::10]
            A = regressor(self._robot, q, still := np.zeros_like(q), still)
        variance = np.einsum("njk,kl,njl->j", A, covariance, A, optimize=True)
        torques: Array = np.sqrt(np.maximum(variance, 0.0) / len(A))
        return torques

    def relative(self, part: Array, p: Array) -> Array:
        """Return `part` relative to the torque of `p`, shape (..., n_joints); 0 without torque."""
        torque = self.rms(p)
        share: Array = np.where(torque > 0, part / np.where(torque > 0, torque, 1.0), 0.0)
        return share


def effect_of_errors(found: Estimate) -> Array:
    """Return the torque of each base parameter's standard error, relative to the rigid-body torque.

    Shape (n_joints, n_base), as root mean squares on a free motion; 0 for an axis without torque.
    """
    free = FreeTorques(found.robot)
    effect: Array = free.relative(free.parameter_torques(found.standard_errors).T, found.values).T
    return np.nan_to_num(effect)


def uncertainty(model: IdentifiedRobot, more: Array | float = 0.0) -> Array | None:
    """Compute each axis's relative standard error of torque on a free motion, (n_joints,).

    Return None for unknown speeds, and 0 for an axis without torque.

    Parameters
    ----------
    more : ndarray, shape (n_base, n_base), optional
        Added to the model's covariance.
    """
    free = free_torques(model)
    if free is None:
        return None
    return free.relative(free.standard_error(model.covariance + more), model.values)


def free_torques(model: IdentifiedRobot) -> FreeTorques | None:
    """Return the torques of a model's robot on a free motion; None if no speeds are known.

    Without limits, speeds are those of the recordings, and accelerations follow from the period.
    """
    fit = model.details
    speed = [law.speed for law in fit.axes] if isinstance(fit, FreeMotionFit) else None
    if speed is None and not np.isfinite(model.robot.velocity_limit).all():
        return None
    return FreeTorques(model.robot, speed)
