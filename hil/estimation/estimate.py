"""Result of an identification: base parameters with uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.fit_details import NO_DETAILS, FitDetails
from hil.estimation.intervals import half_width
from hil.least_squares.uncertainty import correlation_of

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.back_and_forth.description import HalfSums
    from hil.estimation.drive_train import DriveTrain, LoadFriction
    from hil.estimation.free_motion.result import GainValue
    from hil.estimation.intervals import Edge
    from hil.estimation.local_fits import LocalValue
    from hil.estimation.simultaneous import Joint
    from hil.friction.law import FrictionLaw


class LeftOut(NamedTuple):
    """Rejected measurement, with the reason."""

    id: str
    reason: str

    def __str__(self) -> str:
        return f"{self.id}: {self.reason}"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Estimate:
    """Base parameters with uncertainty, and the underlying measurements.

    Attributes
    ----------
    method : str
        One of `hil.estimation.identify.METHODS`.
    p : ndarray, shape (n_base,)
        Base parameters [kg m^2, kg m or kg].
    covariance : ndarray, shape (n_base, n_base)
        Covariance of the errors visible in the data.
    degrees_of_freedom : ndarray, shape (n_base,)
        Effective degrees of freedom: few if few measurements determine a parameter.
    effect : ndarray, shape (n_base, 2 n_joints)
        Change of p per relative change of each torque constant, then of each rotor inertia, whose
        errors are not visible in the data.
    stated : ndarray, shape (2 n_joints,)
        Standard deviations of torque constants and rotor inertias, from the robot file.
    residual : ndarray, shape (n_joints,)
        Root mean square of each axis's torque residual, with friction fitted and signals filtered
        as in the method; for the published method that of the local models of inertia and coupling
        [N m]. NaN for an axis without such a measurement.
    condition : dict
        Condition number of each group's observation matrix, rows weighted by eq. (16); for a
        conventional method that of all parameters, ``"all"``.
    local : tuple of LocalValue
        Step 1: values of the measurements, in the order of the plan; empty for a conventional
        method.
    left_out : tuple of LeftOut
    n_measurements : int
        Number of measurements in the estimate.
    friction_law : FrictionLaw
        Friction law over all recordings; all axes unknown for methods without a law.
    drive_train : DriveTrain, optional
        Compensated torque delay and gear compliance of each axis; None for methods with recorded
        torques and rigid gears.
    load_friction : LoadFriction, optional
        Friction proportional to the transmitted torque; None for methods without it.
    gains : tuple of GainValue
        Gains left unknown by the maps of imports, estimated jointly with the measurements.
    details : FreeMotionFit, BackAndForthFit or MeasurementFit
        Settings and further results, by the kind of recordings.
    half_sums : tuple of HalfSums
        Step 1 of motions back and forth: rigid-body torque over the positions of each recording.
    combination : ndarray, shape (n_base, n_base), optional
        ``combination @ truth`` is the quantity estimated by `p`; None for each parameter itself.
    prior_share : ndarray, shape (n_base,), optional
        Share of each variance, as the data alone give it, from the directions that a prior decides
        (`hil.estimation.prior`); None without a prior.
    joint : Joint, optional
        Regression of all samples of the improved method, for further evaluations.
    edges : tuple of Edge
        Lags and compliances at the edge of the search range.
    shifts : tuple of ndarray, shape (n_base,)
        Change of `p` by the correction of each cause found. The errors contain each shift as one
        standard deviation, because `p` is not corrected.
    """

    method: str
    p: Array
    covariance: Array
    degrees_of_freedom: Array
    effect: Array
    stated: Array
    residual: Array
    condition: dict[str, float]
    local: tuple[LocalValue, ...]
    left_out: tuple[LeftOut, ...]
    n_measurements: int
    friction_law: FrictionLaw
    drive_train: DriveTrain | None = None
    load_friction: LoadFriction | None = None
    details: FitDetails = NO_DETAILS
    half_sums: tuple[HalfSums, ...] = ()
    combination: Array | None = None
    gains: tuple[GainValue, ...] = ()
    prior_share: Array | None = None
    joint: Joint | None = None
    edges: tuple[Edge, ...] = ()
    shifts: tuple[Array, ...] = ()

    @property
    def drive_effect(self) -> Array:
        """Change of p by a standard deviation of every stated drive value, shape of `effect`."""
        return self.effect * self.stated

    @property
    def drive_covariance(self) -> Array:
        """Covariance of `p` from errors of drive values, shape (n_base, n_base)."""
        carried = np.column_stack([self.drive_effect, *self.shifts])
        return carried @ carried.T

    @property
    def standard_error(self) -> Array:
        """Standard errors of `p` from scatter of the data and errors of drive values, (n_base,)."""
        return np.sqrt(np.diag(self.covariance) + np.diag(self.drive_covariance))

    @property
    def correlation(self) -> Array:
        """Correlations of the errors of `p`, shape (n_base, n_base)."""
        return correlation_of(self.covariance + self.drive_covariance)

    def half_width(self, level: float = 0.95) -> Array:
        """Return half-widths of confidence intervals, shape (n_base,)."""
        scatter, stated = np.diag(self.covariance), np.diag(self.drive_covariance)
        return half_width(scatter, stated, self.degrees_of_freedom, level)

    def __repr__(self) -> str:
        return (
            f"<Estimate of {len(self.p)} base parameters, {self.method} method,"
            f" {self.n_measurements} measurements>"
        )
