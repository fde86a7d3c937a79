"""Define the `model.yaml` entries of estimates from motions back and forth."""

from __future__ import annotations

from typing import ClassVar

from checked_files.yaml_file import FileModel
from hil.friction.law import TermValue


class CurvePoint(FileModel):
    """Friction at a speed, from the half-differences of the pairs of an axis.

    Attributes
    ----------
    speed : float
        Speed [rad/s or m/s].
    friction : float
        Mean over the pairs [N m or N].
    half_width : float, optional
        Half-width of the 95 % confidence interval, from the scatter between pairs, which includes
        drift; None for one pair.
    """

    speed: float
    friction: float
    half_width: float | None
    pairs: int


class FrictionCurve(FileModel):
    """Friction of an axis over its speed, without a friction law.

    Attributes
    ----------
    axis : int
        Axis from 1.
    points : tuple of CurvePoint
        Points in order of rising speed.
    by_direction : tuple of TermValue
        Terms equal in both directions apart from the rigid-body torque: a constant, possibly an
        offset of the torque [N m or N], and a term per unit of speed [N m s/rad or N s/m].
    plain : dict of str to TermValue
        Offset, Coulomb and viscous friction fitted alone to samples at all speeds, for comparison
        with other sources [N m or N, viscous per unit of velocity]. Empty for one pair, which has
        no standard error.
    """

    axis: int
    points: tuple[CurvePoint, ...]
    by_direction: tuple[TermValue, TermValue]
    plain: dict[str, TermValue]


class Combination(FileModel):
    """Parameter sum represented by a parameter, in words such as ``p4 + 0.25 p9``."""

    name: str
    stands_for: str


class BackAndForthFit(FileModel):
    """Friction and settings of an estimate from motions back and forth.

    Attributes
    ----------
    cut_off : tuple of float
        Lowest and highest cut-off frequency of the low-pass over the recordings [Hz].
    pairs : int
        Number of pairs of strokes.
    curves : tuple of FrictionCurve
        Friction curves of the moved axes.
    relative_residual : tuple of float or None
        Root mean square residual of the used samples over that of the torque, axis by axis; None
        for an axis that was not moved.
    overall_residual : float
        Relative residual of all axes together.
    not_identified : tuple of str
        Base parameters not excited by the motions; zero in the model.
    combinations : tuple of Combination
        Sums of parameters identified in place of single parameters.
    remarks : tuple of str
        Restrictions of the estimate.
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
    file_key: ClassVar[str | None] = "back_and_forth"
    with_law: ClassVar[bool] = False
    blocks: ClassVar[None] = None
    gains: ClassVar[tuple[()]] = ()
    lag: ClassVar[tuple[()]] = ()
    compliance: ClassVar[dict[int, TermValue]] = {}
    rest: ClassVar[dict[int, float]] = {}

    def sum_of(self, name: str) -> str:
        """Return the sum identified in place of a parameter; empty for the parameter alone."""
        return next((each.stands_for for each in self.combinations if each.name == name), "")
