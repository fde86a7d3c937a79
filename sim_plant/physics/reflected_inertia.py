"""Inertia at the motors, all over the workspace."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sim_plant.physics.rigid_body import WORK, bias_and_mass

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Arm = tuple[tuple[int, ...], Array, Array, Array, Array | None]

CONFIGURATIONS = 50


class NotPositive(ValueError):
    """Mass matrix of links and motors not positive definite."""


def configurations(reach: Array, number: int) -> Array:
    """Return configurations all over the workspace, equal at every call.

    Parameters
    ----------
    reach : ndarray, shape (n, 2)
        Range of travel of the axes [rad or m].
    number : int

    Returns
    -------
    ndarray, shape (number, n)
    """
    low, high = reach.T
    return np.random.default_rng(0).uniform(low, high, (number, len(low)))


def mass_matrix(arm: Arm, q: Array) -> Array:
    """Return M(q) of the links without motors, shape (n, n) [kg m^2, kg m or kg]."""
    n = len(q)
    bias, mass = np.empty(n), np.zeros((n, n))
    bias_and_mass(*arm, q, np.zeros(n), bias, mass, np.empty((n, WORK)))
    lower = np.tril(mass)
    found: Array = lower + np.tril(lower, -1).T
    return found


def gravity_torques(arm: Arm, q: Array) -> Array:
    """Return the gravity torques g(q), shape (n,) [N m or N]."""
    n = len(q)
    bias, mass = np.empty(n), np.zeros((n, n))
    bias_and_mass(*arm, q, np.zeros(n), bias, mass, np.empty((n, WORK)))
    return bias


@dataclass(frozen=True, slots=True, eq=False)
class ReflectedInertia:
    """Mass matrices with motors, and the range of inertia at each motor.

    Attributes
    ----------
    masses : ndarray, shape (m, n, n)
        Mass matrices at configurations all over the workspace [kg m^2, kg m or kg].
    least, greatest : ndarray, shape (n,)
        Inertia with all other axes free, and with all others held [kg m^2 or kg].
    """

    masses: Array
    least: Array
    greatest: Array

    @property
    def middle(self) -> Array:
        """Geometric mean of least and greatest inertia, the best tuning of a velocity loop."""
        mean: Array = np.sqrt(self.least * self.greatest)
        return mean


def reflected_inertia(arm: Arm, motors: Array, reach: Array) -> ReflectedInertia:
    """Compute the inertias at the motors all over the workspace.

    Parameters
    ----------
    arm : tuple
        Joints, frames, bodies, gravity, kinds of `sim_plant.physics.rigid_body`.
    motors : ndarray, shape (n,)
        Motor inertias at the joints [kg m^2 or kg].
    reach : ndarray, shape (n, 2)
        Range of travel of the axes [rad or m].

    Raises
    ------
    NotPositive
        M(q) is not positive definite somewhere.
    """
    q = configurations(reach, CONFIGURATIONS)
    masses = np.array([mass_matrix(arm, each) for each in q]) + np.diag(motors)
    worst = np.linalg.eigvalsh(masses)[:, 0]
    if worst.min() <= 0:
        where = np.round(q[worst.argmin()], 2).tolist()
        raise NotPositive(
            f"M(q) of links and motors is not positive definite at q = {where}; state physically "
            "consistent link parameters"
        )
    free = 1 / np.diagonal(np.linalg.inv(masses), axis1=1, axis2=2)
    held = np.diagonal(masses, axis1=1, axis2=2)
    return ReflectedInertia(masses, free.min(axis=0), held.max(axis=0))
