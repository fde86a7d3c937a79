"""Whether friction of an axis depends on its warmth, and how: by what is held out.

Measurement k of an axis says of its level, by products of its columns (`campaign_friction`),

    y = O a_o + (1 + s (w_k - w_r)) D a_d + e,

with the terms D that change their sign with the direction, the others O, and the warmth w_k that
the history of the axis gave it. For given time constants that is linear in a and nearly so in s:
a few steps of Gauss and Newton. The time constants are the best of a grid.

Levels wander by chance too, and any slow course goes along with some warmth. So the measurements
are held out in blocks, successive in time, and everything is found anew without each. Warmth counts
as identified only where it predicts the blocks better, by more than chance from block to block,
than the law alone and than the law at the level of the last measurement before the block.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.friction.warmth import Warmth, warmth_at
from hil.least_squares.normal_equations import Normal
from hil.least_squares.solving import inverse
from hil.least_squares.uncertainty import sandwich, scatter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.friction.history import History

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

WARMING = (10.0, 30.0, 90.0, 270.0, 810.0, 2430.0)
COOLING = (60.0, 180.0, 540.0, 1620.0, 4860.0)
"""Time constants that are looked for [s]."""
BLOCKS = 10
"""Parts, successive in time, that are held out in turn."""
FEWEST = 12
"""Measurements of an axis below which no warmth is looked for."""
SURE = 2.0
"""Standard errors by which the others must be worse, from block to block."""
STEPS = 4
"""Of Gauss and Newton."""
LEAST_SPREAD = 0.05
"""Range of warmth below which nothing can be said of it."""


class Levels(NamedTuple):
    """What measurements of one axis say of friction by one law, in the order of time.

    Attributes
    ----------
    products : ndarray, shape (n, 1 + n_terms, 1 + n_terms)
        Of what is left for friction and the law's terms.
    directed : ndarray of bool, shape (n_terms,)
        Terms that warmth scales.
    """

    products: Array
    directed: Mask

    def of(self, chosen: Mask) -> Levels:
        """Those of some measurements."""
        return Levels(self.products[chosen], self.directed)

    def errors(self, values: Array, factors: Array) -> Array:
        """Squared error of each measurement by the law with `factors` of its level, shape (n,)."""
        scaled = np.where(self.directed, factors[:, np.newaxis], 1.0) * values
        weights = np.column_stack([np.ones(len(scaled)), -scaled])
        squares: Array = np.einsum("nk,nkl,nl->n", weights, self.products, weights)
        return squares.clip(0.0)

    def deviations(self, values: Array) -> Array:
        """Level of each measurement less that of the law, as a share of it, shape (n,)."""
        directed = np.concatenate([[0.0], np.where(self.directed, values, 0.0)])
        left = np.concatenate([[1.0], -values])
        level = np.einsum("k,nkl,l->n", directed, self.products, directed)
        return np.asarray((self.products @ left @ directed) / np.where(level > 0, level, np.inf))


class WarmLaw(NamedTuple):
    """Coefficients of a law at its mean warmth, their covariance, and how warmth scales it."""

    values: Array
    covariance: Array
    warmth: Warmth


class _Fit(NamedTuple):
    values: Array
    slope: float
    reference: float
    scores: Array
    normal: Array
    left: float

    def factors(self, warmth: Array) -> Array:
        return 1.0 + self.slope * (warmth - self.reference)


def find_warmth(levels: Levels, time: Array, past: History, axis: int) -> WarmLaw | None:
    """Return the law with warmth; None where it predicts no better than without.

    Parameters
    ----------
    levels : Levels
    time : ndarray, shape (n,)
        Of the middle of each measurement, ascending [s].
    past : History
    axis : int
        From 0.
    """
    if len(time) < FEWEST:
        return None
    courses = {
        taus: course
        for taus in product(WARMING, COOLING)
        if np.ptp(course := warmth_at(past, axis, *taus, time)) > LEAST_SPREAD
    }
    if not courses:
        return None
    errors = _held_out(levels, courses)
    if not all(_worse(other, errors[0]) for other in errors[1:]):
        return None
    taus = _best(levels, courses)
    return _law(levels, courses[taus], taus, errors.sum(axis=1))


def _law(levels: Levels, warmth: Array, taus: tuple[float, float], errors: Array) -> WarmLaw | None:
    fit = _fitted(levels, warmth, STEPS)
    covariance = sandwich(inverse(fit.normal), scatter(fit.scores, few=True))
    factors = fit.factors(warmth)
    if fit.slope >= 0.0 or factors.min() <= 0.0:  # gears have less friction when warm, but some
        return None
    left = levels.deviations(fit.values) + 1.0 - factors
    found = Warmth(
        warming=taus[0],
        cooling=taus[1],
        slope=fit.slope,
        slope_error=float(np.sqrt(covariance[-1, -1])),
        reference=fit.reference,
        seen=(float(warmth.min()), float(warmth.max())),
        wander=float(np.abs(left / factors).max()),
        over_law=float(np.sqrt(errors[1] / errors[0])),
        over_last=float(np.sqrt(errors[2] / errors[0])),
    )
    return WarmLaw(fit.values, covariance[:-1, :-1], found)


def _best(levels: Levels, courses: dict[tuple[float, float], Array]) -> tuple[float, float]:
    return min(courses, key=lambda taus: _fitted(levels, courses[taus], 2).left)


def _held_out(levels: Levels, courses: dict[tuple[float, float], Array]) -> Array:
    """Squared errors of blocks by warmth, by the law alone and by the level known last.

    Shape (3, n_blocks).
    """
    n = len(levels.products)
    found = []
    for out in np.array_split(np.arange(n), min(BLOCKS, n // 2)):
        kept = np.ones(n, dtype=bool)
        kept[out] = False
        rest, held = levels.of(kept), levels.of(~kept)
        taus = _best(rest, {each: course[kept] for each, course in courses.items()})
        warm = _fitted(rest, courses[taus][kept], STEPS)
        alone = _fitted(rest, np.zeros(kept.sum()), 1)
        nearest = max(int(out[0]) - 1, 0) if out[0] else int(out[-1]) + 1
        last = 1.0 + levels.deviations(alone.values)[nearest]
        factors = warm.factors(courses[taus][out]), np.ones(len(out)), np.full(len(out), last)
        found.append([
            held.errors(values, each).sum()
            for values, each in zip((warm.values, alone.values, alone.values), factors, strict=True)
        ])  # fmt: skip
    return np.transpose(found)


def _worse(errors: Array, best: Array) -> bool:
    """Whether errors, block by block, are greater by more than chance."""
    excess = errors - best
    return bool(excess.sum() > SURE * np.std(excess, ddof=1) * np.sqrt(len(excess)))


def _fitted(levels: Levels, warmth: Array, steps: int) -> _Fit:
    """Law and slope for given warmth, by steps of Gauss and Newton; no slope without a range."""
    n, m = levels.products.shape[0], len(levels.directed)
    shares = warmth - warmth.mean()
    values, slope = Normal.split(levels.products).solution(), 0.0
    for _ in range(steps):
        columns = np.zeros((n, 1 + m, 2 + m))
        columns[:, 0, 0] = 1.0
        factors = 1.0 + slope * shares
        at = np.arange(m)
        columns[:, 1 + at, 1 + at] = np.where(levels.directed, factors[:, np.newaxis], 1.0)
        columns[:, 1:, 1 + m] = shares[:, np.newaxis] * np.where(levels.directed, values, 0.0)
        P = np.einsum("nki,nkl,nlj->nij", columns, levels.products, columns, optimize=True)
        used = slice(2 + m if shares.any() else 1 + m)
        system = Normal.split(P[:, used, used])
        found = system.solution()
        values = found[:m]
        slope += float(found[m]) if len(found) > m else 0.0
    left = float(levels.errors(values, 1.0 + slope * shares).sum())
    scores = system.scores(found)
    return _Fit(values, slope, float(warmth.mean()), scores, system.information, left)
