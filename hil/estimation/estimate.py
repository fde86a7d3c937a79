"""What an identification finds: base parameters and how far they can be trusted."""

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
    from hil.estimation.local_values import LocalValue
    from hil.estimation.simultaneous import Joint
    from hil.friction.law import FrictionLaw


class LeftOut(NamedTuple):
    """A measurement that could not be used, and why."""

    id: str
    reason: str

    def __str__(self) -> str:
        return f"{self.id}: {self.reason}"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Estimate:
    """Base parameters with their uncertainty and the measurements behind them.

    Attributes
    ----------
    method : str
        One of `hil.estimation.identify.METHODS`.
    p : ndarray, shape (n_base,)
        [kg m^2, kg m or kg].
    covariance : ndarray, shape (n_base, n_base)
        Of all errors that show in the data.
    degrees_of_freedom : ndarray, shape (n_base,)
        Effective ones: few where few measurements carry a parameter.
    effect : ndarray, shape (n_base, 2 n_joints)
        Change of p per relative change of each torque constant, then of each rotor inertia, whose
        errors do not show.
    stated, usual : ndarray, shape (2 n_joints,)
        Standard deviations of these, as the robot file states them; and by usual tolerances where
        it states none (`Robot.usual_uncertainty`).
    residual : ndarray, shape (n_joints,)
        Root mean square of what the model leaves of each axis's torque, friction fitted as the
        method does and after its low-pass; by the published method what the local models of inertia
        and coupling leave [N m]. NaN where an axis was not measured so.
    condition : dict
        Condition number of each group's observation matrix, rows weighted by eq. (16); by a
        conventional method of that of all parameters, ``"all"``.
    local : tuple of LocalValue
        Step 1: each measurement by itself, in the order of the plan; none by a conventional method.
    left_out : tuple of LeftOut
    n_measurements : int
        Measurements behind the estimate.
    friction_law : FrictionLaw
        Friction over all recordings; unknown of all axes where the method looks for no law.
    drive_train : DriveTrain, optional
        By how much each axis's torque was read late and its gear gives way, which is compensated;
        None where the method takes the torque as it was read and gears for rigid.
    load_friction : LoadFriction, optional
        Friction that grows with the transmitted torque; None where the method knows of none.
    gains : tuple of GainValue
        That the maps of imports left unknown, found together with what was measured here.
    details : FreeMotionFit, BackAndForthFit or MeasurementFit
        Settings and what else was found, by the kind of recordings.
    half_sums : tuple of HalfSums
        Step 1 of these: the torque of the rigid bodies over the positions of each recording.
    combination : ndarray, shape (n_base, n_base), optional
        ``combination @ truth`` is what `p` stands for; None where that is each parameter itself.
    prior_share : ndarray, shape (n_base,), optional
        Part of each variance by the data from what they leave open and a prior decides, where one
        was given (`hil.estimation.prior`).
    joint : Joint, optional
        Regression of all samples behind the improved method, for what else is asked of them.
    edges : tuple of Edge
        Lags and compliances that end at the edge of their search range.
    shifts : tuple of ndarray, shape (n_base,)
        Change of `p` by the correction of each cause that was found. The errors contain each shift
        as one standard deviation, because `p` is not corrected.
    """

    method: str
    p: Array
    covariance: Array
    degrees_of_freedom: Array
    effect: Array
    stated: Array
    usual: Array
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
        """Change of p by one standard deviation of each stated drive value, shape of `effect`."""
        return self.effect * self.stated

    @property
    def drive_covariance(self) -> Array:
        """Covariance of `p` from errors that do not show, shape (n_base, n_base)."""
        carried = np.column_stack([self.drive_effect, *self.shifts])
        return carried @ carried.T

    @property
    def standard_error(self) -> Array:
        """Standard errors of `p` from both kinds of error, shape (n_base,)."""
        return np.sqrt(np.diag(self.covariance) + np.diag(self.drive_covariance))

    @property
    def correlation(self) -> Array:
        """Correlations of the errors of `p`, shape (n_base, n_base)."""
        return correlation_of(self.covariance + self.drive_covariance)

    def half_width(self, level: float = 0.95) -> Array:
        """Half-widths of confidence intervals, shape (n_base,)."""
        scatter, stated = np.diag(self.covariance), np.diag(self.drive_covariance)
        return half_width(scatter, stated, self.degrees_of_freedom, level)

    def __repr__(self) -> str:
        return (
            f"<Estimate of {len(self.p)} base parameters, {self.method} method,"
            f" {self.n_measurements} measurements>"
        )
