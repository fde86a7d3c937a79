"""Symmetry of friction in both directions: tests of the one assumption of the two-step method.

The published method takes half the sum of both directions for the gravity torque, so a difference
between the directions becomes an error of p_g (eq. (14)). Each measurement gives this difference as
a share of the friction level, (half-sum - gravity) / half-difference. For each axis the weighted
mean over the measurements is tested against zero by Student's t. The error of the gravity model is
common to all measurements, so it is added to the standard error of the mean.

With enough data every gear is found to be asymmetric. A second p-value therefore tests the
hypothesis that the asymmetry is no larger than a bound; an axis fails only if that is improbable.
An offset of the current sensor looks exactly like asymmetry, and does the same harm.
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
    from hil.estimation.local_fits import LocalValue


BOUND = 0.02
"""Largest acceptable asymmetry, as a share of the friction level: a convention; ``hil friction
--asymmetry`` sets another bound."""


class Symmetry(FileModel):
    """Symmetry test of an axis, as stored in `friction.yaml`.

    Attributes
    ----------
    measurements : int
    asymmetry, standard_error : float
        Excess of forward friction over the mean, as a share of the friction level.
    p_zero : float
        Probability of a mean at least as far from zero if friction is symmetric.
    p_bound : float
        Probability of a mean at least as far beyond `bound` if the asymmetry does not exceed it.
    bound : float
        Share of the friction level.
    passed : bool
        True if an identification may rely on symmetric friction of this axis.
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
        """Result of the symmetry test in words."""
        if not self.passed:
            return f"asymmetric by more than {100 * self.bound:g} %"
        if self.p_zero < SIGNIFICANT:
            return f"asymmetric, within {100 * self.bound:g} %"
        return "no asymmetry found"


def judge_points(points: Sequence[FrictionPoint], bound: float = BOUND) -> dict[int, Symmetry]:
    """Test the symmetry of all axes with a known gravity torque; keys are axes from 0.

    Parameters
    ----------
    points : sequence of FrictionPoint
    bound : float
        Largest acceptable asymmetry, as a share of the friction level.
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


def judge_local_values(values: Iterable[LocalValue], bound: float = BOUND) -> dict[int, Symmetry]:
    """Test the symmetry of axes from gravity measurements; result as in `judge_points`.

    The parameters that predict gravity come from the same measurements. Unless the asymmetry of
    friction was fitted too, as in the improved method, the parameters absorb the mean deviation of
    an axis.
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
    """Test the weighted mean against zero and against the bound."""
    # a few points with small errors must not decide the mean
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
