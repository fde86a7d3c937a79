"""Torque constants from a load of known mass.

A torque constant that is off by a share epsilon makes all torques of its axis wrong by that share
and shows in no residual of a run: the base parameters take it up. The change that a known mass
brings about is known too, however, so two runs, with and without it, identify the constant. With
s = 0 and 1 for the run without and with the load, the torque read on axis a is

    Q = (1 + epsilon_a) [(1 + rho_a) Qm + A (p + s K_n phi)] + friction + common terms,

Qm being the torque of the motor's own inertia, as uncertain (rho) as the robot file says, phi the
load, of which the mass is given and all else is estimated. Least squares over the condensed
measurements of both runs, Gauss-Newton, since gain times parameter is bilinear. Standard errors
come from the scores of the measurements (sandwich), as those of the parameters do.

An axis that feels only what of the load is itself unknown has an uncertain gain: that of the last
axis rests on the load's own inertia alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.load_columns import load_columns, without_mass
from hil.estimation.payload_figures import MASS
from hil.least_squares.solving import solved
from hil.least_squares.terms import N_COMMON
from hil.least_squares.uncertainty import sandwich, scatter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.condensed import Condensed
    from hil.estimation.simultaneous import SimultaneousFit
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

WEAK_PRIOR = 0.5
"""Standard deviation of the gains before any measurement, so that none is undetermined."""
UNIDENTIFIABLE = 0.1
"""Standard error from which on a gain is not identifiable from the load."""
_EXACT = 1e-6
_ROUNDS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Gains:
    """How much the torque constants assumed are off.

    Attributes
    ----------
    error : ndarray, shape (n_joints,)
        epsilon: read torque over true torque, less one.
    standard_error : ndarray, shape (n_joints,)
    constant, constant_error : ndarray, shape (n_joints,)
        Corrected torque constants and their standard errors [N m/A].
    p : ndarray, shape (n_base,)
        Base parameters without the load, corrected.
    """

    error: Array
    standard_error: Array
    constant: Array
    constant_error: Array
    p: Array

    @property
    def identifiable(self) -> NDArray[np.bool_]:
        """Which gains the load identifies, shape (n_joints,)."""
        found: NDArray[np.bool_] = self.standard_error < UNIDENTIFIABLE
        return found


def drive_gains(
    robot: Robot, without: SimultaneousFit, loaded: SimultaneousFit, mass: float
) -> Gains:
    """Find the gains of all axes.

    Parameters
    ----------
    without, loaded : SimultaneousFit
        Condensed measurements of both runs.
    mass : float
        Of the load [kg].
    """
    model = _Bilinear(robot, mass)
    measured = [
        (run.weight, items, loads)
        for run, loads in ((without, False), (loaded, True))
        for items in run.items
    ]
    theta = np.zeros(model.size)
    theta[: model.n_base] = without.solve()
    for _ in range(_ROUNDS):
        scores, information = model.scores(theta, measured)
        theta = theta + solved(information, scores.sum(axis=0) - model.prior * theta)
    scores, information = model.scores(theta, measured)
    meat = scatter(scores) + np.diag(model.stated)
    inverse = solved(information, np.eye(model.size))
    covariance = sandwich(inverse[model.gains], meat)
    error, standard_error = theta[model.gains], np.sqrt(np.diag(covariance))
    constant = robot.torque_constant / (1 + error)
    constant_error = constant / (1 + error) * standard_error
    return Gains(error, standard_error, constant, constant_error, theta[: model.n_base])


class _Bilinear:
    """The model's coefficients and their derivatives by all unknowns.

    Unknown are p, the free parameters of the load, epsilon and rho of all axes, and the common
    terms of every axis in each run.
    """

    def __init__(self, robot: Robot, mass: float) -> None:
        K, free = load_columns(robot)
        fixed = np.zeros(10)
        fixed[MASS] = mass
        self._known, self._load = K @ fixed, K @ without_mass(free)
        self._n, self.n_base = robot.n_joints, len(K)
        first = self.n_base + self._load.shape[1]
        self.gains = np.arange(first, first + self._n)
        self._rotors = self.gains + self._n
        self._common = first + 2 * self._n
        self.size = self._common + 2 * self._n * N_COMMON
        self.prior = np.zeros(self.size)
        self.prior[self.gains] = WEAK_PRIOR**-2
        spread = np.maximum(robot.rotor_inertia_uncertainty, _EXACT)
        self.prior[self._rotors] = spread**-2
        self.stated = np.zeros(self.size)
        self.stated[self._rotors] = spread**-2

    def scores(
        self, theta: Array, measured: Sequence[tuple[Array, Sequence[Condensed], bool]]
    ) -> tuple[Array, Array]:
        """Scores of all measurements, shape (n, size); information with the prior's."""
        found, information = [], np.diag(self.prior)
        for weight, items, loads in measured:
            score = np.zeros(self.size)
            for item in items:
                c, J = self._coefficients(theta, item.axis, loads)
                w = weight[item.axis]
                score += w * J.T @ (item.product[1:, 0] - item.product[1:, 1:] @ c)
                information += w * J.T @ item.product[1:, 1:] @ J
            found.append(score)
        return np.array(found), information

    def _coefficients(self, theta: Array, axis: int, loads: bool) -> tuple[Array, Array]:
        """Of the motor's part, the base parameters and the common terms; and their derivatives."""
        gain, rotor = self.gains[axis], self._rotors[axis]
        own = self._common + (2 * axis + loads) * N_COMMON
        p = theta[: self.n_base].copy()
        base, common = slice(1, 1 + self.n_base), slice(1 + self.n_base, None)
        J = np.zeros((1 + self.n_base + N_COMMON, self.size))
        scale, turning = 1 + theta[gain], 1 + theta[rotor]
        J[0, gain], J[0, rotor] = turning, scale
        J[base, : self.n_base] = scale * np.eye(self.n_base)
        if loads:
            load = slice(self.n_base, self.gains[0])
            p += self._known + self._load @ theta[load]
            J[base, load] = scale * self._load
        J[base, gain] = p
        J[common, own : own + N_COMMON] = np.eye(N_COMMON)
        c = np.concatenate([[scale * turning - 1], scale * p, theta[own : own + N_COMMON]])
        return c, J
