"""Fit parameter groups by successive weighted least squares, as in the paper, eq. (14)-(18).

Gravity measurements give p_g. The moments of inertia, less the contributions of p_g (and of the
gravity torque during the measurement), give p_Md. The coupling inertias, less the contributions of
p_g and p_Md, give p_Mod. Each row is weighted with the reciprocal of its axis's largest torque,
eq. (16).

The whole chain is linear in the measured values, which is used twice: to leave a measurement out,
and to compute the effect of an error of a torque constant or of a rotor inertia.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.solving import fitted
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import GROUPS
from hil.planning.measurement import ELEMENT_KINDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.local_values import LocalFit
    from hil.model.robot import Robot


class TwoStep:
    """Published step 2, over the local fits of step 1."""

    def __init__(self, robot: Robot, local: Sequence[LocalFit]) -> None:
        self._groups = base_parameters(robot).groups
        self._n_base = len(base_parameters(robot))
        self._n_joints = robot.n_joints
        self._group = np.array([ELEMENT_KINDS[f.kind].group for f in local])
        self._axis = np.array([f.axis for f in local])
        self._weight = 1.0 / robot.torque_limit[self._axis]
        self._rows = np.array([f.row + f.sides[2:] for f in local])
        self._torque = np.array([f.sides[0] for f in local])
        self._motor = np.array([f.sides[1] for f in local])

    @property
    def n_measurements(self) -> int:
        """Number of measurements."""
        return len(self._group)

    def solve(self, without: int | None = None) -> Array:
        """Return the base parameters, shape (n_base,), optionally without a measurement."""
        used = np.ones(self.n_measurements, dtype=bool)
        if without is not None:
            used[without] = False
        return self._chain(self._torque - self._motor, used)

    def sensitivity(self) -> Array:
        """Return the change of p per relative change of torque constants, then rotor inertias."""
        everything = np.ones(self.n_measurements, dtype=bool)
        axes = range(self._n_joints)
        of_constants = [self._chain(self._torque * (self._axis == j), everything) for j in axes]
        of_rotors = [self._chain(-self._motor * (self._axis == j), everything) for j in axes]
        return np.array([*of_constants, *of_rotors]).T

    def _chain(self, values: Array, used: Mask) -> Array:
        """Fit the groups successively, less the contributions of preceding groups."""
        p = np.zeros(self._n_base)
        for group in GROUPS:
            columns = list(self._groups[group])
            if columns:
                rows = used & (self._group == group)
                weight = self._weight[rows]
                C = weight * (values[rows] - self._rows[rows] @ p)
                W = weight[:, np.newaxis] * self._rows[np.ix_(rows, columns)]
                p[columns] = fitted(W, C)
        return p
