"""What is found of free motions beside the base parameters, as `model.yaml` keeps it."""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import Field, field_serializer

from checked_files.yaml_file import FileModel
from hil.estimation.intervals import SIGNIFICANT
from hil.friction.law import AxisLaw, CoupledFriction, FrictionLaw, TermValue

FEW_BLOCKS = 8
"""Pieces of time below which scatter between them is no measure of errors: of 7 degrees of freedom
it is uncertain by a quarter, 1 / sqrt(2 * 7)."""
POOR = 1000.0
"""Condition number from which on some combinations of parameters hardly show."""
LOOSE = 0.01
"""Standard error of a parameter as a share of an axis's torque, from which on a remark is made."""
NOTICEABLE = 0.5
"""Standard errors from which on a difference matters."""


class GainValue(FileModel):
    """Gain that the map left unknown, as it was found.

    Attributes
    ----------
    axis : int
        From 1.
    value, standard_error : float
        For one unit of the signal, on the side on which the map reads it [`unit`].
    unit : str
        N m or N.
    """

    axis: int
    value: float
    standard_error: float
    unit: str


class BiasTest(FileModel):
    """Durbin, Wu and Hausman's test whether instruments find the same as least squares.

    Attributes
    ----------
    statistic, p_value : float
        Greatest difference of a parameter over its own standard error, and the chance of one as
        great without any bias.
    shift : float
        Greatest difference of a parameter, over its standard error by least squares.
    """

    statistic: float
    p_value: float
    shift: float

    @property
    def biased(self) -> bool:
        """Whether noise of the motion shifts least squares by more than chance, and noticeably."""
        return self.p_value < SIGNIFICANT and self.shift > NOTICEABLE


class FreeMotionFit(FileModel):
    """Friction and the settings behind an estimate from free motions.

    Attributes
    ----------
    cut_off, band : float
        Of the low-pass of the motion, and of that of torque and columns [Hz].
    cut_off_reason : str
    dead_zone : float
        Samples slower than this share of an axis's speed were not fitted, but count as residuals.
    recorded_velocity : tuple of int
        Axes, from 1, whose velocity was taken as recorded.
    velocity_reasons : tuple of str
        Of each axis why; empty in models that were written without.
    axes : tuple of AxisLaw
    coupled : tuple of CoupledFriction
    relative_residual : tuple of float or None
        Root mean square of the residual of all samples over that of the torque, axis by axis.
    overall_residual : float
        The same of all axes together.
    naive_residual : tuple of float or None
        What the mean torque leaves, relative as `relative_residual`; empty in models that were
        written without.
    blocks : int, optional
        Pieces of time that the recordings were divided into; None in models written without.
    still, driving, unusual : tuple of int
        Axes, from 1, that stand still in all recordings, those whose law of friction gives power to
        the motion, and those with a larger offset than friction has, which passes for weight.
    bias_test : BiasTest, optional
        None where there are too few blocks or samples too far apart.
    least_inertia : float
        Least eigenvalue of the mass matrix with the rotors over the recorded motion, over the
        greatest element of its diagonal there; negative where the estimate is no possible body.
    remarks : tuple of str
        What restricts the estimate.
    gains : tuple of GainValue
        Of axes whose gain the map left unknown.
    lag : tuple of TermValue
        By how much the torque of each axis was recorded after its position [s], 0 where no lag was
        found; taken back before anything was fitted and wherever the model predicts a recording;
        empty in models that were written without.
    compliance : dict of str to TermValue
        Of gears that give way, by axis from 1 [rad/(N m) or m/N], taken into account wherever the
        model predicts a recording.
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
    blocks: int | None = None
    still: tuple[int, ...] = ()
    driving: tuple[int, ...] = ()
    unusual: tuple[int, ...] = ()
    velocity_reasons: tuple[str, ...] = ()
    gains: tuple[GainValue, ...] = ()
    lag: tuple[TermValue, ...] = ()
    compliance: dict[int, TermValue] = Field(default_factory=dict)
    not_identified: ClassVar[tuple[str, ...]] = ()

    def sum_of(self, _name: str) -> str:
        """Return an empty sum: each parameter stands for itself."""
        return ""

    @property
    def law(self) -> FrictionLaw:
        """Law of friction that was found together with the base parameters."""
        return FrictionLaw(axes=self.axes, coupled=self.coupled)

    @field_serializer("axes")
    def _without_what_follows(self, axes: tuple[AxisLaw, ...]) -> list[dict[str, Any]]:
        """Axes without what the level says already, and what only measurements have."""
        others = {"wander", "speeds", "unseen", "measurements", "warmth", "exposure"}
        return [axis.model_dump(mode="json", exclude=others) for axis in axes]
