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

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from checked_files.yaml_file import FileModel
from hil.estimation.intervals import SIGNIFICANT
from hil.least_squares.uncertainty import scatter
from hil.planning.measurement import FOR_A_LAW

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.arrays import Array
    from hil.estimation.friction.points import FrictionPoint
    from hil.estimation.local_values import LocalValue


BOUND = 0.02
"""Largest acceptable asymmetry, as share of the friction level: a convention, for which
``hil friction --asymmetry`` states another one."""


class Symmetry(FileModel):
    """Test of one axis, as `friction.yaml` keeps it.

    Attributes
    ----------
    measurements : int
    asymmetry, standard_error : float
        Share of the friction level by which friction is larger forward than the mean.
    p_zero : float
        Probability of a mean as far from zero, were friction symmetric.
    p_bound : float
        Probability of a mean as far beyond `bound`, were the asymmetry no larger than that.
    bound : float
        Share of the friction level.
    passed : bool
        Whether an identification may rely on symmetric friction of this axis.
    """

    measurements: int
    asymmetry: float
    standard_error: float
    p_zero: float
    p_bound: float
    bound: float
    passed: bool

    @property
    def verdict(self) -> str:
        """State the outcome in words."""
        if not self.passed:
            return f"asymmetric by more than {100 * self.bound:g} %"
        if self.p_zero < SIGNIFICANT:
            return f"asymmetric, within {100 * self.bound:g} %"
        return "no asymmetry found"


def of_points(points: Sequence[FrictionPoint], bound: float = BOUND) -> dict[int, Symmetry]:
    """Test all axes whose gravity torque is known, which the result names by index from 0.

    Parameters
    ----------
    points : sequence of FrictionPoint
    bound : float
        Largest acceptable asymmetry, as share of the friction level.
    """
    found = {}
    for axis in sorted({point.axis for point in points}):
        own = [p for p in points if p.axis == axis and p.absolute and p.friction > 0]
        if len(own) >= FOR_A_LAW:
            level = np.array([p.friction for p in own])
            shares = np.array([p.common for p in own]) / level
            errors = np.array([p.common_error for p in own]) / level
            gravity = float(np.mean([p.gravity_error / p.friction for p in own]))
            found[axis] = _test(shares, errors, gravity, bound)
    return found


def of_local_values(values: Iterable[LocalValue], bound: float = BOUND) -> dict[int, Symmetry]:
    """Test the axes of a campaign's gravity measurements, free of charge; result as of `of_points`.

    The parameters that predict gravity come from the same measurements; they leave the axis's
    mean deviation where friction's asymmetry was fitted too, as the improved method does.
    """
    shares: dict[int, list[float]] = {}
    for v in values:
        if v.symbol == "g" and v.friction > 0:
            shares.setdefault(v.axis, []).append((v.value - v.model) / v.friction)
    return {
        axis: _test(np.array(own), np.ones(len(own)), 0.0, bound)
        for axis, own in sorted(shares.items())
        if len(own) >= FOR_A_LAW
    }


def _test(shares: Array, errors: Array, common: float, bound: float) -> Symmetry:
    """Weighted mean against zero and against the bound."""
    weights = 1.0 / np.maximum(errors, float(np.median(errors))) ** 2
    weights = weights / weights.sum()
    mean, degrees = float(weights @ shares), len(shares) - 1
    scores = (weights * (shares - mean))[:, np.newaxis]
    error = math.hypot(scatter(scores, few=True)[0, 0] ** 0.5, common)
    scale = max(error, float(np.finfo(float).tiny))
    p_bound = float(special.stdtr(degrees, (bound - abs(mean)) / scale))
    return Symmetry(
        measurements=len(shares),
        asymmetry=mean,
        standard_error=error,
        p_zero=float(2 * special.stdtr(degrees, -abs(mean) / scale)),
        p_bound=p_bound,
        bound=bound,
        passed=p_bound >= SIGNIFICANT,
    )
