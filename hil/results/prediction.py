"""What uncertain parameters mean in torques: how well the model predicts a motion it never saw.

A parameter's standard error says little by itself: 0.01 kg m^2 is nothing at the first axis and
much at the last. Carried through the regressor to a free motion of the robot (`trajectory`),
tau = A p with the covariance A C A', all errors become comparable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.model.dynamics import regressor
from hil.results.validation_motion import free_motion

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot

    Array = NDArray[np.float64]


class FreeTorques:
    """Rigid-body torques on a free motion by what they are linear in, as root mean squares.

    `speed` counts where the robot's limits are unknown (`free_motion`).
    """

    def __init__(self, robot: Robot, speed: ArrayLike | None = None) -> None:
        motion = free_motion(robot, speed=speed)
        self._A = regressor(robot, motion.q, motion.qd, motion.qdd)

    def rms(self, p: Array) -> Array:
        """Of base parameters or a change of them, shape (n_joints,) [N m]."""
        torques: Array = np.sqrt(np.mean((self._A @ p) ** 2, axis=0))
        return torques

    def of_each(self, p: Array) -> Array:
        """Of each base parameter by itself, shape (n_joints, n_base) [N m]."""
        torques: Array = np.sqrt(np.mean(self._A**2, axis=0)) * p
        return torques

    def standard_error(self, covariance: Array) -> Array:
        """From the covariance of base parameters, shape (n_joints,) [N m]."""
        variance = np.einsum("njk,kl,njl->j", self._A, covariance, self._A, optimize=True)
        torques: Array = np.sqrt(np.maximum(variance, 0.0) / len(self._A))
        return torques


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Rigid-body torques on a free motion, as root mean squares over it.

    Attributes
    ----------
    torque, standard_error : ndarray, shape (n_joints,)
        [N m].
    effect : ndarray, shape (n_joints, n_base)
        Torque that one standard error of each parameter by itself amounts to [N m].
    """

    torque: Array
    standard_error: Array
    effect: Array

    @property
    def relative(self) -> Array:
        """Standard error over torque, shape (n_joints,); NaN for a joint without torque."""
        share: Array = self.standard_error / self._some_torque
        return share

    @property
    def relative_effect(self) -> Array:
        """`effect` over torque, shape (n_joints, n_base); NaN for a joint without torque."""
        share: Array = self.effect / self._some_torque[:, np.newaxis]
        return share

    @property
    def _some_torque(self) -> Array:
        return np.where(self.torque > 0, self.torque, np.nan)


def predict(estimate: Estimate, robot: Robot) -> Prediction:
    """Predict the torques of a free motion with their uncertainty."""
    torques = FreeTorques(robot)
    return Prediction(
        torque=torques.rms(estimate.p),
        standard_error=torques.standard_error(estimate.covariance + estimate.drive_covariance),
        effect=torques.of_each(estimate.standard_error),
    )
