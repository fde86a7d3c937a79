"""What lies between the current and the arm, axis by axis: late readings, soft gears, friction.

Drives filter or queue the current that they report, positions they do not: 4 ms between the two
cost half a percent of the inertias and leave residuals that look like friction. And encoders sit on
the motors' side of gears that give way: with a compliance c_j of the gear of axis j, which
transmits Q_t,j, the link is at q_j = theta_j - c_j Q_t,j where the encoder says theta_j. A share
mu_j of what a gear transmits is friction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class DriveTrain:
    """By how much torque readings lag behind positions, and how far gears give way.

    Attributes
    ----------
    lag : ndarray, shape (n_joints,)
        Positive where the torque is late [s]; zero where it is not identifiable.
    lag_error : ndarray, shape (n_joints,)
        Standard errors [s]; NaN where the lag is not identifiable.
    compliance : ndarray, shape (n_joints,)
        Of each axis's gear [rad/(N m)], as measured: also where it is not `soft`.
    compliance_error : ndarray, shape (n_joints,)
        Standard errors [rad/(N m)]; NaN where nothing shows a compliance.
    soft : ndarray of bool, shape (n_joints,)
        Gears that give way significantly. The others count as rigid.
    covariance : ndarray, shape (n_base, n_base)
        Of the base parameters, from errors of the lags.
    p : ndarray, shape (n_base,)
        Base parameters by which the gears' torques are calculated.
    """

    lag: Array
    lag_error: Array
    compliance: Array
    compliance_error: Array
    soft: NDArray[np.bool_]
    covariance: Array
    p: Array

    def applied(self, robot: Robot, s: Signals, compliance: Array | None = None) -> Signals:
        """Signals with torques as early as positions, and with links where soft gears let them.

        Parameters
        ----------
        compliance : ndarray, shape (n_joints,), optional
            Others than those of the gears that are soft.
        """
        found = s.torque_advanced(self.lag)
        c = np.where(self.soft, self.compliance, 0.0) if compliance is None else compliance
        if not c.any():
            return found
        twist = c * inverse_dynamics(robot, self.p, s.q, s.qd, s.qdd)
        # what is transmitted is that of the links' own motion, so once more
        moved = replace(found, twist=twist)
        return replace(found, twist=c * inverse_dynamics(robot, self.p, *moved.link))


class LoadFriction(NamedTuple):
    """Share of the transmitted torque that is friction, axis by axis, and its standard error.

    Both of shape (n_joints,); NaN where no transmitted torque shows it.
    """

    mu: Array
    standard_error: Array


def directly_driven(robot: Robot) -> DriveTrain:
    """Torque taken as it was read, gears taken as rigid."""
    n, n_base = robot.n_joints, len(base_parameters(robot))
    zero, unknown = np.zeros(n), np.full(n, np.nan)
    soft = np.zeros(n, dtype=bool)
    return DriveTrain(
        zero, unknown, zero, unknown, soft, np.zeros((n_base, n_base)), np.zeros(n_base)
    )


def compliance_units(robot: Robot) -> str:
    """Unit of a column of compliances of all joints, in millionths."""
    each = ("µrad/(N m)" if robot.revolute[axis] else "µm/N" for axis in range(robot.n_joints))
    return " or ".join(dict.fromkeys(each))
