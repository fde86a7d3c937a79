"""Result of an identification: base parameters with uncertainty, and details by recordings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, NamedTuple, TypeAlias

import numpy as np

from checked_files.yaml_file import FileModel
from hil.estimation.back_and_forth.result import BackAndForthFit
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.intervals import half_width
from hil.friction.law import TermValue
from hil.least_squares.regression import ByName
from hil.least_squares.uncertainty import correlation_of
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.back_and_forth.description import HalfSums
    from hil.estimation.drive_train import DriveTrain, LoadFriction
    from hil.estimation.free_motion.result import GainValue
    from hil.estimation.intervals import Edge
    from hil.estimation.local_fits import LocalValue
    from hil.estimation.simultaneous import Joint
    from hil.friction.law import FrictionLaw
    from hil.model.robot import Robot


class MeasurementFit(FileModel):
    """Empty details of a fit to strokes and trajectories.

    Friction is fitted anew in each measurement, and the lags and gears of a drive train are not
    part of the model.
    """

    file_key: ClassVar[str | None] = None
    """Key of the details in `model.yaml`; None if nothing is written."""
    with_law: ClassVar[bool] = False
    """True if the friction law was estimated together with the base parameters."""
    blocks: ClassVar[None] = None
    curves: ClassVar[tuple[()]] = ()
    gains: ClassVar[tuple[()]] = ()
    lag: ClassVar[tuple[()]] = ()
    compliance: ClassVar[dict[int, TermValue]] = {}
    not_identified: ClassVar[tuple[str, ...]] = ()
    rest: ClassVar[dict[int, float]] = {}

    def sum_of(self, _name: str) -> str:
        """Return an empty sum, since every parameter is identified individually."""
        return ""


FitDetails: TypeAlias = FreeMotionFit | BackAndForthFit | MeasurementFit
NO_DETAILS = MeasurementFit()


class LeftOut(NamedTuple):
    """Rejected measurement, with the reason."""

    id: str
    reason: str

    def __str__(self) -> str:
        return f"{self.id}: {self.reason}"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Estimate(ByName):
    """Base parameters of a robot with uncertainty, and the underlying measurements.

    Attributes
    ----------
    method : str
        One of `hil.estimation.identify.METHODS`.
    values : ndarray, shape (n_base,)
        Base parameters [kg m^2, kg m or kg, as in `units`].
    scatter_covariance, drive_covariance : ndarray, shape (n_base, n_base)
        Covariance of errors visible in the data, and of invisible errors: torque constants and
        rotor inertias with the uncertainty stated in the robot file, and causes found but not
        corrected (`covariance_of_drives`).
    degrees_of_freedom : ndarray, shape (n_base,)
        Effective degrees of freedom of the errors visible in the data: few if few measurements
        determine a parameter.
    residual : ndarray, shape (n_joints,)
        Root mean square of each axis's residual torque, with the method's low-pass and friction
        fit; for the published method that of the local models of inertia and coupling [N m or N].
        NaN for an axis that was not measured.
    condition : dict
        Condition number of each group's observation matrix, rows weighted by eq. (16); for a
        conventional method that of all parameters, ``"all"``.
    friction_law : FrictionLaw
        Friction to be overcome by the drives; unknown for all axes for methods without a law, and
        in models from files of versions without friction.
    local : tuple of LocalValue
        Step 1: values of the single measurements with their friction, in the order of the plan;
        empty for a conventional method, and for a file of an earlier version.
    details : FreeMotionFit, BackAndForthFit or MeasurementFit
        Settings and further results, by the kind of recordings. Free motions have cut-off, lags,
        gears and gains; strokes of single axes have friction curves over the speed, and
        unidentified parameters.
    effect : ndarray, shape (n_base, 2 n_joints)
        Change of `values` per relative change of each torque constant, then of each rotor inertia,
        whose errors are not visible in the data. A file has the first half, or none of it.
    edges : tuple of Edge
        Lags and compliances at the edge of their search range.
    n_measurements : int
        Number of measurements in the estimate.
    drive_train : DriveTrain, optional
        Compensated torque delay and gear compliance of each axis; None for methods with recorded
        torques and rigid gears, as the attributes below, which a file does not have.
    load_friction : LoadFriction, optional
        Friction proportional to the transmitted torque.
    gains : tuple of GainValue
        Gains left unknown by the maps of imports, estimated jointly with the measurements.
    half_sums : tuple of HalfSums
        Step 1 of motions back and forth: rigid-body torque over the positions of each recording.
    combination : ndarray, shape (n_base, n_base), optional
        ``combination @ truth`` is the quantity estimated by `values`; None for each parameter
        itself, and in files of earlier versions.
    prior_share : ndarray, shape (n_base,), optional
        Share of each variance, as the data alone give it, from the directions that a prior decides
        (`hil.estimation.prior`); None without a prior.
    joint : Joint, optional
        Regression of all samples of the improved method, for further evaluations.
    """

    robot: Robot
    method: str
    values: Array
    scatter_covariance: Array
    drive_covariance: Array
    degrees_of_freedom: Array
    residual: Array
    condition: dict[str, float]
    friction_law: FrictionLaw
    local: tuple[LocalValue, ...] = ()
    details: FitDetails = NO_DETAILS
    effect: Array = field(default_factory=lambda: np.zeros((0, 0)))
    edges: tuple[Edge, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    n_measurements: int = 0
    drive_train: DriveTrain | None = None
    load_friction: LoadFriction | None = None
    gains: tuple[GainValue, ...] = ()
    half_sums: tuple[HalfSums, ...] = ()
    combination: Array | None = None
    prior_share: Array | None = None
    joint: Joint | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the base parameters, ``p1`` and on."""
        return base_parameters(self.robot).names

    @property
    def drive_effect(self) -> Array:
        """Change of `values` by a standard deviation of every stated drive value, as `effect`."""
        return self.effect * self.robot.stated_uncertainty

    @property
    def covariance(self) -> Array:
        """Total covariance of `values`, by visible and invisible errors, shape (n_base, n_base)."""
        return self.scatter_covariance + self.drive_covariance

    @property
    def correlation(self) -> Array:
        """Correlations of the errors of `values`, shape (n_base, n_base)."""
        return correlation_of(self.covariance)

    @property
    def identified(self) -> Mask:
        """Which of `values` were identified, shape (n_base,); the others are zero."""
        return np.array([name not in self.details.not_identified for name in self.names])

    @property
    def standard_errors(self) -> Array:
        """Standard errors of `values`, shape (n_base,); NaN for unidentified parameters."""
        errors: Array = np.where(self.identified, np.sqrt(np.diag(self.covariance)), np.nan)
        return errors

    def half_width(self, level: float = 0.95) -> Array:
        """Return half-widths of confidence intervals, shape (n_base,)."""
        scatter, stated = np.diag(self.scatter_covariance), np.diag(self.drive_covariance)
        return half_width(scatter, stated, self.degrees_of_freedom, level)

    @property
    def _found(self) -> dict[str, tuple[float, float]]:
        pairs = zip(self.values.tolist(), self.standard_errors.tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))

    def _half_widths(self, level: float) -> dict[str, float]:
        half = np.where(self.identified, self.half_width(level), np.nan)
        return dict(zip(self.names, half.tolist(), strict=True))


def covariance_of_drives(robot: Robot, effect: Array, shifts: Sequence[Array] = ()) -> Array:
    """Return the covariance of base parameters from errors that the data do not show.

    Parameters
    ----------
    effect : ndarray, shape (n_base, 2 n_joints)
        See `Estimate`; the robot file states the standard deviations.
    shifts : sequence of ndarray, shape (n_base,)
        Changes of the parameters by the correction of each cause found. Each shift counts as one
        standard deviation, because the parameters are not corrected.

    Returns
    -------
    ndarray, shape (n_base, n_base)
    """
    carried = np.column_stack([effect * robot.stated_uncertainty, *shifts])
    return np.asarray(carried @ carried.T)
