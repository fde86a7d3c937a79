"""Warmth of a gear: the state that scales friction between cold and warm.

Friction falls while an axis moves, as its power warms the gear and motion stirs the lubricant, and
rises again at rest. One state of each axis stands for that, from 0 of a cold, rested gear to 1 of
one as warm as motion can make it:

    w' = (1 - w) (x / x0) / tau_warming - w / tau_cooling,

driven by what is measured, the mean speed x as a share of the axis's limit (`speed` of its law), of
which the friction power is much the same multiple at every speed; x0 = `REFERENCE`. Within a
stretch of one mean speed it relaxes exponentially. It scales the level of friction, all that
changes its sign with the direction, by

    1 + s (w - w_r),

with w_r the mean warmth of what the law of friction was found from, so that the law by itself is
friction at that warmth. Beyond what was seen warmth counts as the nearest that was.

Whether friction of an axis depends on it is asked of measurements, each of which says of the level

    y = O a_o + (1 + s (w_k - w_r)) D a_d + e,

with the terms D that change their sign with the direction, the others O, and the warmth w_k that
the history of the axis gave it. For given time constants that is linear in a and nearly so in s:
a few steps of Gauss and Newton. The time constants are the best of a grid. Levels wander by chance
too, and any slow course goes along with some warmth. So the measurements are held out in parts,
successive in time, and everything is found anew without each. Warmth counts as identified only
where it predicts the parts certainly better than the law alone (`hil.least_squares.choice`), and no
worse than the law at the level of the last measurement before, which a level that walks by chance
keeps to. Of 100 walks two passed for warmth; what a campaign of the virtual plant showed of four
axes left 0.63 to 0.99 of friction's residual in four other runs, seen when the rule was made.

Most campaigns identify none. What friction does elsewhere is then open, all the more the less the
axis has gone through there what it went through where the law was found (`Exposure`). With the
states w_m for time constants m of a grid and their means over the measurements, the level of the
law is taken to differ by a standard deviation u of

    u^2 = s^2 + S^2 D^2,    D^2 = mean over m of (w_m - mean w_m)^2,

with the scatter s of the levels of the measurements about the law. S, the change from cold to as
warm as motion makes a gear, is `COLD_TO_WARM`, or as much more as the measurements themselves
showed: the root of the sum of their squared deviations over that of their D^2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from pydantic import Field
from scipy.linalg.lapack import dtbtrs

from checked_files.yaml_file import FileModel
from hil.friction.terms import DIRECTED
from hil.least_squares.choice import FOLDS, folds, simplest
from hil.least_squares.regression import Regression
from hil.least_squares.solving import solve_each

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from hil.arrays import Array, Mask
    from hil.least_squares.blocks import Blocks


REFERENCE = 0.5
"""Mean speed, as share of the limit, that `warming` is stated for: a convention."""
TIMES = (
    (10.0, 30.0, 90.0, 270.0, 810.0, 2430.0),
    (60.0, 180.0, 540.0, 1620.0, 4860.0),
)
"""Time constants of warming and cooling that are tried, from those of a stroke to those of a
campaign, a factor of three apart: levels half a factor off are hardly other ones [s]."""
COURSES = tuple(product((10.0, 90.0, 810.0), (60.0, 540.0, 4860.0)))
"""Time constants of the states that an exposure is stated in: every other one of `TIMES`."""
COLD_TO_WARM = 0.4
"""Change of the level from cold to as warm as motion makes a gear, a standard deviation, as a share
of it. Virtual plants, which follow published measurements of gears, have 0.2 to 0.6 of it
(`sim_plant.physics.friction`); with 0.3 intervals held 72 to 100 % of the levels of other motions,
axis by axis, with 0.4 it was 83 to 100 % (three plants, strokes and trajectories)."""
STEPS = 4
"""Of Gauss and Newton: the slope is a share of the level, and its error is squared in each."""


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """Mean speeds of all axes, stretch by stretch of time.

    Attributes
    ----------
    end : ndarray, shape (n,)
        When each stretch ends, the first beginning at `begin` [s].
    speed : ndarray, shape (n, n_joints)
        Mean speed within it as share of the axis's limit.
    begin : float
        [s].
    """

    end: Array
    speed: Array
    begin: float


class Warmth(FileModel):
    """How friction of one axis depends on its warmth.

    Attributes
    ----------
    warming : float
        Time constant of warming up at half the speed limit [s].
    cooling : float
        Time constant of cooling at rest [s].
    slope, slope_error : float
        Relative change of the level from w = 0 to 1, of the level at `reference`; standard error.
    reference : float
        Warmth at which the law stands.
    seen : tuple of two floats
        Least and greatest warmth of the measurements that the law was found from.
    wander : float
        Greatest difference of the level in one measurement from the law at its warmth, as a share.
    over_law, over_last : float
        Root mean square error of blocks of measurements held out: of the law at any warmth, and of
        the law at the level that was known last, each over that of the law at their warmth.
    """

    warming: float = Field(gt=0)
    cooling: float = Field(gt=0)
    slope: float
    slope_error: float = Field(ge=0)
    reference: float
    seen: tuple[float, float]
    wander: float
    over_law: float
    over_last: float

    def away(self, warmth: ArrayLike) -> Array:
        """Warmth less the law's own, no further than was seen, shape of `warmth`."""
        return np.asarray(np.clip(warmth, *self.seen) - self.reference, dtype=np.float64)

    def factor(self, warmth: ArrayLike) -> Array:
        """What the level of the law is multiplied by, shape of `warmth`."""
        return 1.0 + self.slope * self.away(warmth)

    def deviation(self, warmth: ArrayLike) -> Array:
        """Standard deviation of the level at a warmth, over that of the law; shape of `warmth`."""
        uncertain = self.slope_error * self.away(warmth)
        return np.asarray(np.hypot(self.wander * self.factor(warmth), uncertain))

    @property
    def cold(self) -> float:
        """Level at the least warmth seen over that of the law."""
        return float(self.factor(self.seen[0]))

    @property
    def warm(self) -> float:
        """Level at the greatest warmth seen over that of the law."""
        return float(self.factor(self.seen[1]))


class Exposure(FileModel):
    """What an axis had gone through in the measurements that its law was found from.

    Attributes
    ----------
    states : tuple of float
        Mean warmth for each of `COURSES`.
    widest : float
        Greatest D of a measurement.
    scatter : float
        Of the level in one measurement about the law, a standard deviation as a share of it.
    slope : float
        S, as a share of the level.
    """

    states: tuple[float, ...]
    widest: float
    scatter: float
    slope: float

    @classmethod
    def of(cls, states: Array, deviations: Array, n_terms: int) -> Self:
        """Exposure of measurements.

        Parameters
        ----------
        states : ndarray, shape (n, n_courses)
            Warmth in each of them.
        deviations : ndarray, shape (n,)
            Level of each less that of the law, as a share.
        n_terms : int
            Of the level, which the same measurements gave.
        """
        away, square = np.mean((states - states.mean(axis=0)) ** 2, axis=1), deviations @ deviations
        seen = math.sqrt(square / max(float(away.sum()), np.finfo(float).tiny))
        return cls(
            states=tuple(states.mean(axis=0).tolist()),
            widest=math.sqrt(float(away.max())),
            scatter=math.sqrt(square / max(len(deviations) - n_terms, 1)),
            # friction that vanishes is the most that warmth can do
            slope=min(max(COLD_TO_WARM, seen), 1.0),
        )

    def distance(self, states: Array) -> Array:
        """D of states, shape (n, n_courses): shape (n,)."""
        return np.asarray(np.sqrt(np.mean((states - np.array(self.states)) ** 2, axis=1)))

    def deviation(self, distance: ArrayLike) -> Array:
        """Standard deviation of the level, u, at a distance; shape of it."""
        return np.asarray(np.hypot(self.scatter, self.slope * np.asarray(distance)))

    @property
    def anywhere(self) -> float:
        """D of an axis of which nothing is known.

        It is anywhere between cold and as warm as steady motion at `REFERENCE` makes it.
        """
        steady = np.array([cooling / (warming + cooling) for warming, cooling in COURSES])
        squares = steady**2 / 12.0 + (steady / 2.0 - np.array(self.states)) ** 2
        return float(np.sqrt(squares.mean()))


def states_at(past: History, axis: int, time: Array) -> Array:
    """Warmth of an axis (from 0) for each of `COURSES` at instants (n,): (n, n_courses)."""
    return np.column_stack([warmth_at(past, axis, *taus, time) for taus in COURSES])


def warmth_at(
    past: History, axis: int, warming: float, cooling: float, time: Array, start: float = 0.0
) -> Array:
    """Warmth of an axis at instants of its history, shape of `time`.

    Parameters
    ----------
    past : History
    axis : int
        From 0.
    warming, cooling : float
        Time constants [s].
    time : ndarray, shape (n,)
        [s].
    start : float
        Warmth where the history begins, cold by default.
    """
    ends = np.append(past.begin, past.end)
    heating = past.speed[:, axis] / REFERENCE / warming
    rate = heating + 1.0 / cooling
    states = relaxed(start, heating / rate, np.exp(-np.diff(ends) * rate))
    return np.asarray(np.interp(time, ends, states), dtype=np.float64)


def relaxed(start: float, goals: Array | Mask, left: Array) -> Array:
    """A state that goes from `start` to one goal after the other, shape (1 + n_goals,).

    Of its distance from each goal the share `left` remains, shape (n_goals,).
    """
    # each state less its share of the last one: a triangular band, solved from the top
    band = np.array([np.ones(len(left) + 1), np.append(-left, 0.0)])
    states, _ = dtbtrs(band, np.append(start, (1.0 - left) * goals), uplo="L", diag="U")
    return np.asarray(states[:, 0] if states.ndim > 1 else states)


class WarmLaw(NamedTuple):
    """Coefficients of a law at its mean warmth, their covariance, and how warmth scales it."""

    values: Array
    covariance: Array
    warmth: Warmth


def find_warmth(levels: Blocks, time: Array, past: History, axis: int) -> WarmLaw | None:
    """Return the law with warmth; None where it predicts no better than without.

    Parameters
    ----------
    levels : Blocks
        One channel with the terms of the law, a group for each measurement, in the order of time.
    time : ndarray, shape (n,)
        Of the middle of each measurement, ascending [s].
    past : History
    axis : int
        From 0.
    """
    # range of warmth below which its slope would be one of 20 times what was seen
    courses = {
        taus: course
        for taus in product(*TIMES)
        if np.ptp(course := warmth_at(past, axis, *taus, time)) > 0.05
    }
    if len(time) < FOLDS or not courses:
        return None
    law, last, warm = _held_out(levels, courses)
    if simplest({"law": law, "warmth": warm}) == "law" or last.sum() <= warm.sum():
        return None
    taus = _best(levels, courses)
    fit, warmth = _fitted(levels, courses[taus], STEPS), courses[taus]
    factors = fit.factors(warmth)
    covariance = fit.regression.uncertainty("clusters").covariance
    if fit.slope >= 0.0 or factors.min() <= 0.0:  # gears have less friction when warm, but some
        return None
    left = deviations(levels, fit.values) + 1.0 - factors
    found = Warmth(
        warming=taus[0],
        cooling=taus[1],
        slope=fit.slope,
        slope_error=float(np.sqrt(covariance[-1, -1])),
        reference=fit.reference,
        seen=(float(warmth.min()), float(warmth.max())),
        wander=float(np.abs(left / factors).max()),
        over_law=float(np.sqrt(law.sum() / warm.sum())),
        over_last=float(np.sqrt(last.sum() / warm.sum())),
    )
    return WarmLaw(fit.values, covariance[:-1, :-1], found)


def deviations(levels: Blocks, values: Array) -> Array:
    """Level of each measurement less that of the law, as a share of it, shape (n,)."""
    products = levels.products[:, 0]
    directed = np.concatenate([[0.0], np.where(np.isin(levels.own, DIRECTED), values, 0.0)])
    left = np.concatenate([[1.0], -values])
    level = np.einsum("k,nkl,l->n", directed, products, directed)
    return np.asarray((products @ left @ directed) / np.where(level > 0, level, np.inf))


class _Fit(NamedTuple):
    """A law at its mean warmth `reference`, its relative slope, and the regression behind both."""

    values: Array
    slope: float
    reference: float
    regression: Regression

    def factors(self, warmth: Array) -> Array:
        return 1.0 + self.slope * (warmth - self.reference)


def _fitted(levels: Blocks, warmth: Array, steps: int) -> _Fit:
    """Law and slope for given warmth, by steps of Gauss and Newton; no slope without a range."""
    away, reference = warmth - warmth.mean(), float(warmth.mean())
    m, directed = len(levels.own), np.isin(levels.own, DIRECTED)
    names, at = (*levels.own, "slope") if away.any() else levels.own, 1 + np.arange(m)
    values, slope = Regression(levels, np.ones(1), at - 1).solution, 0.0
    for _ in range(steps):
        T = np.zeros((len(levels), 1, 1 + m, 1 + len(names)))
        T[:, 0, 0, 0] = 1.0
        T[:, 0, at, at] = np.where(directed, 1.0 + slope * away[:, np.newaxis], 1.0)
        if away.any():
            T[:, 0, 1:, -1] = away[:, np.newaxis] * np.where(directed, values, 0.0)
        around = levels.combined(T, (), names)
        regression = Regression(around, np.ones(1), np.arange(len(names)))
        values, slope = regression.solution[:m], slope + float(regression.solution[m:].sum())
    return _Fit(values, slope, reference, regression)


def _errors(levels: Blocks, values: Array, factors: Array) -> Array:
    """Squared error of each measurement by the law with `factors` of its level, shape (n,)."""
    scaled = np.where(np.isin(levels.own, DIRECTED), factors[:, np.newaxis], 1.0) * values
    around = np.column_stack([np.ones(len(scaled)), -scaled])
    squares: Array = np.einsum("nk,nkl,nl->n", around, levels.products[:, 0], around)
    return squares.clip(0.0)


def _best(levels: Blocks, courses: dict[tuple[float, float], Array]) -> tuple[float, float]:
    """Time constants that leave least after two steps of `_fitted`, all of them at once.

    Its equations are sums over measurements of their products times powers of warmth.
    """
    course, products = np.array(list(courses.values())), levels.products[:, 0]
    away = course - course.mean(axis=1, keepdims=True)
    plain, once, twice = (np.tensordot(away**power, products, 1) for power in range(3))
    directed = np.concatenate([[0.0], np.isin(levels.own, DIRECTED)])
    either = directed[:, np.newaxis] + directed
    values, slope = solve_each(plain[:, 1:, 1:], plain[:, 1:, 0]), np.zeros((len(course), 1, 1))

    def scaled() -> Array:
        return np.asarray(plain + slope * either * once + slope**2 * (either == 2) * twice)

    m = len(values[0])
    for _ in range(2):
        level = directed[1:] * values
        change = (once + slope * directed[:, np.newaxis] * twice)[:, :, 1:] @ level[..., np.newaxis]
        N = np.empty((len(course), m + 1, m + 1))
        system = scaled()
        N[:, :m, :m] = system[:, 1:, 1:]
        N[:, :m, m] = N[:, m, :m] = change[:, 1:, 0]
        N[:, m, m] = np.einsum("ki,kij,kj->k", level, twice[:, 1:, 1:], level)
        x = solve_each(N, np.column_stack([system[:, 1:, 0], change[:, 0, 0]]))
        values, slope = x[:, :m], slope + x[:, m:, np.newaxis]
    around = np.column_stack([np.ones(len(course)), -values])
    left = np.einsum("ki,kij,kj->k", around, scaled(), around)
    return list(courses)[int(np.argmin(left))]


def _held_out(levels: Blocks, courses: dict[tuple[float, float], Array]) -> Array:
    """Squared errors of parts by the law alone, by the level known last and by warmth.

    Shape (3, n_parts).
    """
    found = []
    for out in folds(len(levels)):
        kept = np.ones(len(levels), dtype=bool)
        kept[out] = False
        rest, held = levels.where(kept), levels.where(~kept)
        taus = _best(rest, {each: course[kept] for each, course in courses.items()})
        warm = _fitted(rest, courses[taus][kept], STEPS)
        alone, same = _fitted(rest, np.zeros(len(rest)), 1).values, np.ones(len(held))
        last = 1.0 + deviations(rest, alone)[max(out.start - 1, 0)]
        tried = (alone, same), (alone, last * same), (warm.values, warm.factors(courses[taus][out]))
        found.append([_errors(held, *each).sum() for each in tried])
    return np.transpose(found)
