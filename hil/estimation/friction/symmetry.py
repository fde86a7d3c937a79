"""Is friction the same in both directions? The one assumption of the two-step method.

The published method takes half the sum of both directions for the gravity torque, so any difference
between them becomes an error of p_g (eq. (14)). Each measurement gives that difference as a share
of the friction level, (half-sum - gravity) / half-difference. Over the measurements of an axis the
weighted mean is tested against zero by Student's t; what the gravity model is uncertain by is
common to all of them and added to the standard error of the mean.

With enough data any gear is found to be asymmetric. So there is a second p-value, of the hypothesis
that the asymmetry is no larger than a bound; an axis fails only where that is improbable. An offset
of the current sensor looks, and does harm, exactly like asymmetry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.intervals import SIGNIFICANT
from hil.least_squares.uncertainty import scatter

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from hil.estimation.friction.points import FrictionPoint
    from hil.estimation.local_values import LocalValue

    Array = NDArray[np.float64]

BOUND = 0.02
"""Largest acceptable asymmetry, as share of the friction level."""
FEWEST = 3
"""Measurements of an axis that a test needs."""


@dataclass(frozen=True, slots=True)
class Symmetry:
    """Test of one axis.

    Attributes
    ----------
    axis : int
        From 0.
    n : int
        Measurements.
    asymmetry, standard_error : float
        Share of the friction level by which friction is larger forward than the mean.
    p_zero : float
        Probability of a mean as far from zero, were friction symmetric.
    p_bound : float
        Probability of a mean as far beyond `bound`, were the asymmetry no larger than that.
    bound : float
        Share of the friction level.
    """

    axis: int
    n: int
    asymmetry: float
    standard_error: float
    p_zero: float
    p_bound: float
    bound: float

    @property
    def passed(self) -> bool:
        """Whether an identification may rely on symmetric friction of this axis."""
        return self.p_bound >= SIGNIFICANT

    @property
    def verdict(self) -> str:
        """State the outcome in words."""
        if not self.passed:
            return f"asymmetric by more than {100 * self.bound:g} %"
        if self.p_zero < SIGNIFICANT:
            return f"asymmetric, within {100 * self.bound:g} %"
        return "no asymmetry found"


def of_points(points: Sequence[FrictionPoint], bound: float = BOUND) -> list[Symmetry]:
    """Test all axes whose gravity torque is known.

    Parameters
    ----------
    points : sequence of FrictionPoint
    bound : float
        Largest acceptable asymmetry, as share of the friction level.
    """
    found = []
    for axis in sorted({point.axis for point in points}):
        own = [p for p in points if p.axis == axis and p.absolute and p.friction > 0]
        level = np.array([p.friction for p in own])
        shares = np.array([p.common for p in own]) / level
        errors = np.array([p.common_error for p in own]) / level
        gravity = float(np.mean([p.gravity_error / p.friction for p in own])) if own else 0.0
        found += _test(axis, shares, errors, gravity, bound)
    return found


def of_local_values(values: Iterable[LocalValue], bound: float = BOUND) -> list[Symmetry]:
    """Test the axes of a campaign's gravity measurements, free of charge.

    The parameters that predict gravity come from the same measurements; they leave the axis's
    mean deviation where friction's asymmetry was fitted too, as the improved method does.
    """
    gravity = [v for v in values if v.symbol == "g" and v.friction > 0]
    found = []
    for axis in sorted({v.axis for v in gravity}):
        own = [v for v in gravity if v.axis == axis]
        shares = np.array([(v.value - v.model) / v.friction for v in own])
        found += _test(axis, shares, np.ones(len(own)), 0.0, bound)
    return found


def _test(axis: int, shares: Array, errors: Array, common: float, bound: float) -> list[Symmetry]:
    """Weighted mean against zero and against the bound; empty with too few measurements."""
    n = len(shares)
    if n < FEWEST:
        return []
    usual = float(np.median(errors))
    weights = 1.0 / np.maximum(errors, usual) ** 2
    weights = weights / weights.sum()
    mean = float(weights @ shares)
    scores = (weights * (shares - mean))[:, np.newaxis]
    error = float(np.sqrt(scatter(scores, few=True)[0, 0] + common**2))
    degrees = n - 1
    beyond = (abs(mean) - bound) / error if error > 0 else np.copysign(np.inf, abs(mean) - bound)
    away = abs(mean) / error if error > 0 else np.copysign(np.inf, abs(mean))
    return [
        Symmetry(
            axis=axis,
            n=n,
            asymmetry=mean,
            standard_error=error,
            p_zero=float(2 * special.stdtr(degrees, -away)),
            p_bound=float(special.stdtr(degrees, -beyond)),
            bound=bound,
        )
    ]
