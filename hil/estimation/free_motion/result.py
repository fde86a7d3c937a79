"""Define the `model.yaml` entries of estimates from free motions."""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import Field, field_serializer

from checked_files.yaml_file import FileModel
from hil.estimation.intervals import SIGNIFICANT
from hil.friction.law import AxisLaw, CoupledFriction, FrictionLaw, TermValue

FEW_BLOCKS = 8
"""Fewest pieces of time for an error estimate from their scatter: with 7 degrees of freedom it is
uncertain by a quarter, 1 / sqrt(2 * 7)."""
POOR = 1000.0
"""Largest condition number with well excited combinations of parameters."""
LOOSE = 0.01
"""Largest standard error of a parameter, as a share of an axis's torque, without a remark."""
NOTICEABLE = 0.5
"""Smallest relevant shift of a parameter, in standard errors."""


class GainValue(FileModel):
    """Estimated gain, left unknown by the map.

    Attributes
    ----------
    axis : int
        Axis from 1.
    value, standard_error : float
        Gain for one unit of the signal, on the side read by the map [`unit`].
    unit : str
        Unit of the torque: N m or N.
    """

    axis: int
    value: float
    standard_error: float
    unit: str


class BiasTest(FileModel):
    """Durbin-Wu-Hausman test of least squares against instrumental variables.

    Attributes
    ----------
    statistic, p_value : float
        Largest difference of a parameter over the difference's standard error, and the probability
        of a value as large without bias.
    shift : float
        Largest difference of a parameter, over its standard error by least squares.
    change : tuple of float
        Significant differences of base parameters, 0 for others; empty if unknown.
    """

    statistic: float
    p_value: float
    shift: float
    change: tuple[float, ...] = ()

    @property
    def biased(self) -> bool:
        """True if noise of the motion biases least squares significantly and noticeably."""
        return self.p_value < SIGNIFICANT and self.shift > NOTICEABLE


class Change(FileModel):
    """A change during the recordings.

    Attributes
    ----------
    axis : int
        Axis, from 1, whose torque shows the change most.
    after : float
        Time of all recordings before the change [s].
    left : float
        Share of the axis's mean square error left by separate fits before and after the change.
    """

    axis: int
    after: float
    left: float


class FreeMotionFit(FileModel):
    """Friction and settings of an estimate from free motions.

    Attributes
    ----------
    cut_off, band : float
        Cut-off frequencies of the low-pass of the motion, and of that of torque and columns [Hz].
    dead_zone : float
        Slowest fitted speed as a share of an axis's speed; slower samples are included in
        residuals.
    moving_only : bool
        True if torques of resting axes are not used.
    recorded_velocity : tuple of int
        Axes with recorded velocity, from 1.
    velocity_reasons : tuple of str
        Reason for each axis; empty in models of earlier versions.
    relative_residual : tuple of float or None
        Root mean square residual of all samples over that of the torque, axis by axis.
    overall_residual : float
        Relative residual of all axes together.
    naive_residual : tuple of float or None
        Relative residual of a constant torque; empty in models of earlier versions.
    repeated : tuple of float
        Share of the most frequent torque in the faster half of the samples, axis by axis; empty in
        models of earlier versions.
    blocks : int, optional
        Number of pieces of time of the recordings; None in models of earlier versions.
    still, driving, unusual : tuple of int
        Axes, from 1: at rest in all recordings; with a friction law that supplies power to the
        motion; with an offset larger than usual for friction, which resembles weight.
    rest : dict of int to float
        Positions of the axes at rest, by axis from 1 [rad or m]; empty in models of earlier
        versions.
    not_identified : tuple of str
        Base parameters without data, because axes are at rest.
    bias_test : BiasTest, optional
        None for too few blocks or too low sampling rates.
    least_inertia : float
        Smallest eigenvalue of the mass matrix with the rotors over the recorded motion, in units of
        each joint's own inertia; negative if the estimate is physically impossible.
    remarks : tuple of str
        Restrictions of the estimate.
    gains : tuple of GainValue
        Gains left unknown by the map.
    lag : tuple of TermValue
        Delay of each axis's recorded torque after the position [s], 0 if no lag was found;
        compensated before the fit and in predictions of recordings; empty in models of earlier
        versions.
    compliance : dict of str to TermValue
        Compliances of the soft gears, by axis from 1 [rad/(N m) or m/N], included in predictions of
        recordings.
    change : Change, optional
        Change during the recordings; None without one.
    """

    cut_off: float
    band: float
    cut_off_reason: str
    dead_zone: float
    recorded_velocity: tuple[int, ...]
    axes: tuple[AxisLaw, ...]
    coupled: tuple[CoupledFriction, ...]
    relative_residual: tuple[float | None, ...]
    overall_residual: float
    bias_test: BiasTest | None
    least_inertia: float
    remarks: tuple[str, ...]
    naive_residual: tuple[float | None, ...] = ()
    repeated: tuple[float, ...] = ()
    blocks: int | None = None
    still: tuple[int, ...] = ()
    driving: tuple[int, ...] = ()
    unusual: tuple[int, ...] = ()
    rest: dict[int, float] = Field(default_factory=dict)
    not_identified: tuple[str, ...] = ()
    velocity_reasons: tuple[str, ...] = ()
    gains: tuple[GainValue, ...] = ()
    lag: tuple[TermValue, ...] = ()
    compliance: dict[int, TermValue] = Field(default_factory=dict)
    change: Change | None = None
    moving_only: bool = False
    file_key: ClassVar[str | None] = "friction"
    with_law: ClassVar[bool] = True
    curves: ClassVar[tuple[()]] = ()

    def sum_of(self, _name: str) -> str:
        """Return an empty text: every parameter is identified individually."""
        return ""

    @property
    def law(self) -> FrictionLaw:
        """Friction law estimated together with the base parameters."""
        return FrictionLaw(axes=self.axes, coupled=self.coupled)

    @field_serializer("axes")
    def _drop_derived(self, axes: tuple[AxisLaw, ...]) -> list[dict[str, Any]]:
        """Serialise axes without redundant entries and entries of measurements only."""
        others = {"wander", "speeds", "misfit", "unseen", "measurements", "warmth", "exposure"}
        return [axis.model_dump(mode="json", exclude=others) for axis in axes]
