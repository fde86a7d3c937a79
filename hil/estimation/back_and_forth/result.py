"""What motions back and forth show beside the base parameters, as `model.yaml` keeps it."""

from __future__ import annotations

from typing import ClassVar

from checked_files.yaml_file import FileModel
from hil.friction.law import TermValue


class CurvePoint(FileModel):
    """Friction at one speed: the half-differences of all pairs of an axis thereabouts.

    Attributes
    ----------
    speed : float
        [rad/s or m/s].
    friction : float
        Mean over the pairs [N m or N].
    half_width : float, optional
        Of its interval of 95 %, from the scatter between pairs, which holds what drifts; None where
        there is one pair.
    pairs : int
    """

    speed: float
    friction: float
    half_width: float | None
    pairs: int


class FrictionCurve(FileModel):
    """Friction of one axis over its speed, no law assumed.

    Attributes
    ----------
    axis : int
        From 1.
    points : tuple of CurvePoint
        By rising speed.
    by_direction : tuple of TermValue
        What is the same forth and back and no rigid body's: a constant, which may be an offset of
        the torque [N m or N], and per unit of speed [N m s/rad or N s/m].
    plain : dict of str to TermValue
        What offset, Coulomb's and viscous friction alone would be, of samples at all speeds: for
        comparison with other sources [N m or N, the viscous per unit of velocity]. Empty where
        there is one pair, which shows no standard error.
    """

    axis: int
    points: tuple[CurvePoint, ...]
    by_direction: tuple[TermValue, TermValue]
    plain: dict[str, TermValue]


class Combination(FileModel):
    """A parameter that stands for a sum, in words such as ``p4 + 0.25 p9``."""

    name: str
    stands_for: str


class BackAndForthFit(FileModel):
    """Friction and settings behind an estimate from motions back and forth.

    Attributes
    ----------
    cut_off : tuple of float
        Of the low-pass of all signals, the lowest and the highest of all recordings [Hz].
    cut_off_reason : str
    pairs : int
        Of strokes.
    curves : tuple of FrictionCurve
        Of the axes that were moved.
    relative_residual : tuple of float or None
        Root mean square of what base parameters and friction leave of all samples that were used,
        over that of the torque, axis by axis; None for an axis that was not moved.
    overall_residual : float
        The same of all axes together.
    not_identified : tuple of str
        Base parameters that the motions do not show; they are zero in the model.
    combinations : tuple of Combination
        Parameters that were identified together with some of these.
    remarks : tuple of str
        What restricts the estimate.
    """

    cut_off: tuple[float, float]
    cut_off_reason: str
    pairs: int
    curves: tuple[FrictionCurve, ...]
    relative_residual: tuple[float | None, ...]
    overall_residual: float
    not_identified: tuple[str, ...]
    combinations: tuple[Combination, ...]
    remarks: tuple[str, ...]
    gains: ClassVar[tuple[()]] = ()
    lag: ClassVar[tuple[()]] = ()
    compliance: ClassVar[dict[int, TermValue]] = {}

    def sum_of(self, name: str) -> str:
        """Sum that was identified in place of a parameter; empty where it is the parameter."""
        return next((each.stands_for for each in self.combinations if each.name == name), "")
