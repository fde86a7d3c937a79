"""What an identification finds: base parameters and how far they can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.local_values import LocalValue

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Base parameters with their uncertainty and the measurements behind them.

    Attributes
    ----------
    method : str
        "improved" or "printed".
    p : ndarray, shape (n_base,)
        [kg m^2, kg m or kg].
    covariance : ndarray, shape (n_base, n_base)
        Of all errors that show in the data.
    degrees_of_freedom : ndarray, shape (n_base,)
        Effective ones: few where few measurements carry a parameter.
    drive_covariance : ndarray, shape (n_base, n_base)
        Of errors that do not show: torque constants and rotor inertias, as uncertain as the robot
        file says.
    drive_effect : ndarray, shape (n_base, 2 n_joints)
        Change of p by one standard deviation of each of them; the torque constants come first.
    residual : ndarray, shape (n_joints,)
        Root mean square of what the local models of inertia and coupling leave of each axis's
        torque [N m]; NaN where an axis was not measured so.
    condition : dict
        Condition number of each group's observation matrix, rows weighted by eq. (16).
    local : tuple of LocalValue
        Step 1: each measurement by itself, in the order of the plan.
    left_out : tuple of str
        Measurements that could not be used, and why.
    lag, lag_error : ndarray, shape (n_joints,)
        By how much each axis's torque was read late, which is compensated, and its standard error
        [s]; 0 and NaN where the measurements do not tell.
    """

    method: str
    p: Array
    covariance: Array
    degrees_of_freedom: Array
    drive_covariance: Array
    drive_effect: Array
    residual: Array
    condition: dict[str, float]
    local: tuple[LocalValue, ...]
    left_out: tuple[str, ...]
    lag: Array
    lag_error: Array

    @property
    def standard_error(self) -> Array:
        """Standard errors of `p` from both kinds of error, shape (n_base,)."""
        errors: Array = np.sqrt(np.diag(self.covariance) + np.diag(self.drive_covariance))
        return errors

    def half_width(self, level: float = 0.95) -> Array:
        """Half-widths of confidence intervals, shape (n_base,).

        Student's t with the effective degrees of freedom for what shows in the data; the normal
        distribution for what the robot file states.
        """
        tail = 0.5 + level / 2
        seen = stats.t.ppf(tail, self.degrees_of_freedom) ** 2 * np.diag(self.covariance)
        stated = stats.norm.ppf(tail) ** 2 * np.diag(self.drive_covariance)
        half: Array = np.sqrt(seen + stated)
        return half
