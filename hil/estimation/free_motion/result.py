"""What is found of free motions beside the base parameters, as `model.yaml` keeps it."""

from __future__ import annotations

import math
from typing import Self

from checked_files.yaml_file import FileModel
from hil.estimation.intervals import SIGNIFICANT, TWICE

FEW_BLOCKS = 8
"""Pieces of time below which scatter between them is no measure of errors: of 7 degrees of freedom
it is uncertain by a quarter, 1 / sqrt(2 * 7)."""
POOR = 1000.0
"""Condition number from which on some combinations of parameters hardly show."""
LOOSE = 0.01
"""Standard error of a parameter as a share of an axis's torque, from which on a remark is made."""
NOTICEABLE = 0.5
"""Standard errors from which on a difference matters."""


class TermValue(FileModel):
    """Coefficient of one term of friction [N m or N], and its standard error."""

    value: float
    standard_error: float

    @classmethod
    def estimated(cls, value: float, variance: float) -> Self:
        """From a variance, which rounding may leave below zero."""
        return cls(value=float(value), standard_error=math.sqrt(max(variance, 0.0)))


class OneWay(FileModel):
    """An axis that moves in one direction only, where Coulomb friction and offset are one column.

    Attributes
    ----------
    direction : int
        1 or -1.
    together : TermValue
        Offset plus Coulomb friction in this direction [N m or N].
    """

    direction: int
    together: TermValue

    def __str__(self) -> str:
        value, half = self.together.value, TWICE * self.together.standard_error
        return (
            "moves in one direction only, so Coulomb friction and an offset cannot be separated:"
            f" together they are {value:.3g} ± {half:.2g}"
        )


class AxisFriction(FileModel):
    """Friction of one axis.

    Attributes
    ----------
    law : str
        One of `hil.estimation.free_motion.friction_terms.LAWS`.
    speed : float
        That velocities are divided by [rad/s or m/s]; the axis hardly ever exceeds it.
    terms : dict of str to TermValue
        By the names of `hil.estimation.free_motion.friction_terms.TERMS`.
    covariance : tuple of tuple of float
        Of the coefficients of `terms`, in their order [(N m)^2 or N^2]; empty in files of earlier
        versions, whose standard errors then count as independent.
    beside : tuple of tuple of float
        Covariance of each of `terms` with the base parameters; empty in files of earlier versions,
        and where friction was found apart from them.
    plain : dict of str to TermValue
        What offset, Coulomb's and viscous friction alone would be, of samples at all speeds: for
        comparison with other sources. The law that was chosen may share them out otherwise.
    presliding : float
        Distance over which friction turns round after a reversal [rad or m]; 0 for at once.
    bend : TermValue
        Of what the direction changes with the logarithm of this distance [N m or N].
    held_out : dict of str to float
        Root mean square error of all axes on held-out blocks by law, over that of the law chosen;
        empty where no law was chosen.
    level : tuple of float
        Of friction at instants spread evenly over the time recorded, the first and the last
        included, over its mean, which `terms` state; empty where it keeps its level.
    one_way : OneWay, optional
        None for an axis that moves in both directions.
    """

    law: str
    speed: float
    presliding: float = 0.0
    bend: TermValue = TermValue(value=0.0, standard_error=0.0)
    terms: dict[str, TermValue]
    plain: dict[str, TermValue]
    held_out: dict[str, float]
    covariance: tuple[tuple[float, ...], ...] = ()
    beside: tuple[tuple[float, ...], ...] = ()
    level: tuple[float, ...] = ()
    one_way: OneWay | None = None


class CoupledFriction(FileModel):
    """Friction of a motor that turns with two joints, from 1, in their combined velocity."""

    motor: int
    joint: int
    viscous: TermValue
    coulomb: TermValue


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


class LagValue(FileModel):
    """By how much the torque of one axis was recorded after its position, and the standard error.

    Both 0 where no lag was found [s].
    """

    value: float
    standard_error: float


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
    axes : tuple of AxisFriction
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
    lag : tuple of LagValue
        Of each axis, taken back before anything was fitted and wherever the model predicts a
        recording; empty in models that were written without.
    """

    cut_off: float
    band: float
    cut_off_reason: str
    dead_zone: float
    recorded_velocity: tuple[int, ...]
    axes: tuple[AxisFriction, ...]
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
    lag: tuple[LagValue, ...] = ()
