"""Warmth of a gear: a state that scales friction between cold and warm.

Friction falls during motion, as friction power warms the gear and motion stirs the lubricant, and
rises again at rest. One state of each axis describes this, from 0 of a cold, rested gear to 1 of a
gear as warm as motion can make it:

    w' = (1 - w) (x / x0) / tau_warming - w / tau_cooling,

with the mean speed x as a share of the reference speed of the law, which is nearly proportional to
friction power, and x0 = `REFERENCE`. Within a stretch of constant mean speed w relaxes
exponentially. Warmth scales the level of friction, all terms that change sign with the direction,
by

    1 + s (w - w_r),

with the mean warmth w_r of the measurements, so that the law without warmth is friction at w_r.
Outside the observed range, warmth counts as the nearest observed value.

The test of whether an axis's friction depends on warmth uses the level of each measurement,

    y = O a_o + (1 + s (w_k - w_r)) D a_d + e,

with the terms D that change sign with the direction, the other terms O, and the warmth w_k from the
history of the axis. For given time constants the equation is linear in a and nearly linear in s: a
few Gauss-Newton steps. A grid yields the time constants. Levels also change by chance, and every
slow change correlates with some warmth. Therefore successive parts of the measurements are held
out, and all unknowns are estimated without each part. Warmth counts as identified only if it
predicts the held-out parts certainly better than the law alone (`hil.least_squares.choice`) and no
worse than the level of the last measurement before, the best predictor of a random walk. 2 of 100
random walks were accepted; on four axes of a virtual plant the warmth of one campaign left 0.63 to
0.99 of friction's residual in four other runs (runs used for the choice of the rule).

Most campaigns identify no warmth. The friction in other motions is then uncertain, the more so the
more the history of the axis differs from that of the measurements (`Exposure`). With the states w_m
for n_m pairs of time constants and their differences x_m = w_m - mean w_m from the means over the
measurements, the level of the law deviates by a standard deviation u of

    u^2 = s^2 + S^2 D^2,    D^2 = mean over m of x_m^2,

with the scatter s of the levels of the measurements about the law. S, the change of the level from
cold to warm, is `COLD_TO_WARM` or the change observed in the measurements if larger: the root of
the sum of their squared deviations over the sum of their D^2.

S is an assumption. The measurements determine the level where they passed through the same states:
for slopes b_m of independent prior variance S^2 / n_m, their levels, X b + e, have the posterior

    V = (n_m I / S^2 + X' X / r^2)^-1,    b = V X' (levels) / r^2,    v^2 = x' V x,

with the scatter r about X b of the greatest evidence (D. J. C. MacKay, Bayesian interpolation,
Neural Computation 4 (1992) 415-447). The measurements cover a motion with v < r on all of its path
but the share that correct 95 % intervals leave out. There

    u^2 = c^2 (r^2 + v^2)

about the level 1 + x' b, with c, Student's t over the normal quantile, for the few degrees of
freedom of r. The covariance of the law still counts the course as scatter, which leaves room for
levels that differ between runs by more than r: without it only 78 % of an axis's samples in a
repeated trajectory were inside 95 % intervals. For other motions u is mostly assumed, and stays S D
wide: with the slopes alone, trajectories after strokes had 83 % inside (four plants, seeds 2201 to
2204).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator
from scipy import special

from checked_files.yaml_file import FileModel
from hil.friction.terms import DIRECTED
from hil.least_squares.choice import FOLDS, folds, simplest
from hil.least_squares.regression import Regression
from hil.least_squares.solving import solve_each, solved
from hil.least_squares.uncertainty import OUTSIDE, TWICE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from hil.arrays import Array, Mask
    from hil.least_squares.blocks import Blocks


REFERENCE = 0.5
"""Mean speed at which `warming` is the time constant, as a share of the limit: a convention."""
TIMES = ((10.0, 30.0, 90.0, 270.0, 810.0, 2430.0), (60.0, 180.0, 540.0, 1620.0, 4860.0))
"""Grid of time constants of warming and cooling, from the duration of a stroke to that of a
campaign, a factor of three apart: half a grid step hardly changes the levels [s]."""
COURSES = tuple(product((10.0, 90.0, 810.0), (60.0, 540.0, 4860.0)))
"""Time constants of the states of an exposure: every other value of `TIMES`."""
COLD_TO_WARM = 0.4
"""Relative change of the level from cold to warm, a standard deviation. Virtual plants, which
follow published measurements of gears, have 0.2 to 0.6 (`sim_plant.physics.friction`). Intervals
contained 72 to 100 % of the levels of other motions with 0.3, and 83 to 100 % with 0.4 (by axis,
three plants, strokes and trajectories)."""
LEAST_REDUCTION = 1e-3
"""Smallest stated reduction of a direction's variance; smaller ones change v by 0.05 % at most."""
ROUNDS = 20
"""Number of iterations of the scatter r: within 1e-6 of its limit for 18 virtual plants."""
PARTS = 10
"""Number of instants in a stretch of time at which warmth is looked up along the path."""
STEPS = 4
"""Number of Gauss-Newton steps; each squares the relative error of the slope."""


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """Mean speeds of all axes in successive stretches of time.

    Attributes
    ----------
    end : ndarray, shape (n,)
        End of each stretch [s].
    speed : ndarray, shape (n, n_joints)
        Mean speed within each stretch as a share of the axis's limit.
    begin : float
        Beginning of the first stretch [s].
    """

    end: Array
    speed: Array
    begin: float


class Warmth(FileModel):
    """Dependence of an axis's friction on warmth.

    Attributes
    ----------
    warming : float
        Time constant of warming up at half the speed limit [s].
    cooling : float
        Time constant of cooling at rest [s].
    slope, slope_error : float
        Change of the level from w = 0 to 1, as a share of the level at `reference`, and its
        standard error.
    reference : float
        Warmth of the law's coefficients.
    seen : tuple of two floats
        Least and greatest warmth of the measurements.
    wander : float
        Largest relative deviation of the level of a measurement from the law at its warmth.
    over_law, over_last : float
        Root mean square error of held-out measurements, relative to the law with warmth: of the law
        without warmth, and of the law at the level of the last measurement before.
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
        """Return the difference of warmth from the reference, clipped to the observed range."""
        return np.asarray(np.clip(warmth, *self.seen) - self.reference, dtype=np.float64)

    def factor(self, warmth: ArrayLike) -> Array:
        """Return the factor of the level at a warmth, shape of `warmth`."""
        return 1.0 + self.slope * self.away(warmth)

    def deviation(self, warmth: ArrayLike) -> Array:
        """Return the relative standard deviation of the level at a warmth, shape of `warmth`."""
        uncertain = self.slope_error * self.away(warmth)
        return np.asarray(np.hypot(self.wander * self.factor(warmth), uncertain))

    @property
    def cold(self) -> float:
        """Relative level at the least observed warmth."""
        return float(self.factor(self.seen[0]))

    @property
    def warm(self) -> float:
        """Relative level at the greatest observed warmth."""
        return float(self.factor(self.seen[1]))


class Exposure(FileModel):
    """Warming of an axis in the measurements of its friction law.

    Attributes
    ----------
    states : tuple of float
        Mean warmth for each of `COURSES`.
    scatter : float
        Relative standard deviation of the levels of measurements about the law.
    slope : float
        S: relative change of the level from cold to warm.
    explored : tuple of tuples of float
        Directions of the states of measurements, shape (n, n_courses). The squared length of each
        is the reduction of the prior variance by the measurements, below 1. Empty in files of
        earlier versions.
    slopes : tuple of float
        b: relative change of the level with each state, (n_courses,); empty in files of earlier
        versions.
    left, degrees : float
        r: relative standard deviation of the levels about `slopes`, and its degrees of freedom.
    """

    states: tuple[float, ...]
    scatter: float
    slope: float
    explored: tuple[tuple[float, ...], ...] = ()
    slopes: tuple[float, ...] = ()
    left: float = 0.0
    degrees: float = Field(default=1.0, ge=1.0)

    @model_validator(mode="before")
    @classmethod
    def _drop_widest(cls, stated: Any) -> Any:
        """Drop the largest distance of a measurement, stated in files of earlier versions."""
        if isinstance(stated, dict):
            stated = {name: value for name, value in stated.items() if name != "widest"}
        return stated

    @classmethod
    def compute(cls, states: Array, deviations: Array, lost: float) -> Self:
        """Compute the exposure of measurements.

        Parameters
        ----------
        states : ndarray, shape (n, n_courses)
            Warmth in each measurement, for each of `COURSES`.
        deviations : ndarray, shape (n,)
            Relative deviation of each measurement's level from the law.
        lost : float
            Degrees of freedom of the deviations lost to the law (`lost_degrees`).
        """
        X, square = states - states.mean(axis=0), deviations @ deviations
        seen = math.sqrt(square / max(float(np.mean(X**2, axis=1).sum()), np.finfo(float).tiny))
        scatter = math.sqrt(square / max(len(deviations) - lost, 1.0))
        # warmth can at most make friction vanish
        slope = min(max(COLD_TO_WARM, seen), 1.0)
        information, directions = np.linalg.eigh(X.T @ X)
        tiny = np.finfo(float)
        information = np.where(information > tiny.eps * information.max(), information, 0.0)
        sums = np.where(information > 0, directions.T @ X.T @ deviations, 0.0)
        prior, n, left = X.shape[1] / slope**2, len(X), scatter
        for _ in range(ROUNDS):
            # lower bound for levels without scatter
            left = max(left, tiny.eps**0.5 * max(scatter, tiny.tiny**0.5))
            known = information + prior * left**2
            slopes, reduction = sums / known, information / known
            rest = square - 2.0 * slopes @ sums + slopes @ (information * slopes)
            # degrees of freedom without the effective number of slopes and the terms of the level
            degrees = float(n - reduction.sum()) * max(n - lost, 1.0) / n
            left = math.sqrt(max(float(rest), 0.0) / degrees)
        explored = (np.sqrt(reduction) * directions).T[reduction > LEAST_REDUCTION]
        return cls(
            states=tuple(states.mean(axis=0).tolist()),
            scatter=scatter,
            slope=slope,
            explored=tuple(tuple(each) for each in explored.round(4).tolist()),
            slopes=tuple((directions @ slopes).tolist()),
            left=left,
            degrees=max(degrees, 1.0),
        )

    def distance(self, states: Array) -> Array:
        """Return D of states, shape (n, n_courses); result of shape (n,)."""
        return np.asarray(np.sqrt(np.mean((states - np.array(self.states)) ** 2, axis=1)))

    def deviation(self, distance: ArrayLike) -> Array:
        """Return the standard deviation u of the level at a distance D, shape of `distance`."""
        return np.asarray(np.hypot(self.scatter, self.slope * np.asarray(distance)))

    def unexplored(self, states: Array) -> Array:
        """Return the standard deviation v of the level at states, shape (n, n_courses): (n,)."""
        x = states - np.array(self.states)
        known = x @ np.reshape(self.explored, (-1, x.shape[1])).T
        square = np.sum(x**2, axis=1) - np.sum(known**2, axis=1)
        return np.asarray(self.slope * np.sqrt(square.clip(0.0) / x.shape[1]))

    def covers(self, past: History, axis: int) -> bool:
        """Return True if the measurements cover the motion of an axis in a history."""
        lasting = np.diff(past.end, prepend=past.begin)
        within = (np.arange(PARTS) + 0.5) / PARTS - 1.0
        time = (past.end[:, np.newaxis] + lasting[:, np.newaxis] * within).ravel()
        beyond = self.unexplored(states_at(past, axis, time)) > (self.left or self.scatter)
        path = np.repeat(lasting * past.speed[:, axis], PARTS)
        return bool(path @ beyond <= OUTSIDE * path.sum())

    def level_along(self, past: History, axis: int, time: Array) -> tuple[Array, Array]:
        """Return the change x' b of an axis's level at instants [s] of a history, and its u."""
        states = states_at(past, axis, time)
        if not self.slopes or not self.covers(past, axis):
            return np.zeros(len(time)), self.deviation(self.distance(states))
        change = (states - np.array(self.states)) @ np.array(self.slopes)
        few = float(special.stdtrit(self.degrees, 0.975)) / TWICE
        return change, np.asarray(few * np.hypot(self.left, self.unexplored(states)))

    @property
    def anywhere(self) -> float:
        """D of an axis with unknown history.

        Warmth is equally likely anywhere between cold and steady motion at `REFERENCE`.
        """
        steady = np.array([cooling / (warming + cooling) for warming, cooling in COURSES])
        squares = steady**2 / 12.0 + (steady / 2.0 - np.array(self.states)) ** 2
        return float(np.sqrt(squares.mean()))


def states_at(past: History, axis: int, time: Array) -> Array:
    """Return the warmth of an axis (from 0) at instants, for each of `COURSES`: (n, n_courses)."""
    return np.column_stack([warmth_at(past, axis, *taus, time) for taus in COURSES])


def warmth_at(
    past: History, axis: int, warming: float, cooling: float, time: Array, start: float = 0.0
) -> Array:
    """Return the warmth of an axis at instants of its history, shape of `time`.

    Parameters
    ----------
    axis : int
        Axis from 0.
    warming, cooling : float
        Time constants [s].
    time : ndarray, shape (n,)
        Instants [s].
    start : float
        Warmth at the beginning of the history, cold by default.
    """
    ends = np.append(past.begin, past.end)
    heating = past.speed[:, axis] / REFERENCE / warming
    rate = heating + 1.0 / cooling
    states = relaxed(start, heating / rate, np.exp(-np.diff(ends) * rate))
    return np.asarray(np.interp(time, ends, states), dtype=np.float64)


def relaxed(start: float, goals: Array | Mask, left: Array) -> Array:
    """Compute a state that relaxes from `start` towards successive goals, shape (1 + n_goals,).

    The share `left`, shape (n_goals,), of the distance from each goal remains.
    """
    from scipy.linalg.lapack import dtbtrs  # noqa: PLC0415 - takes long to load

    # x_k - left_k x_(k-1) = (1 - left_k) goal_k: a bidiagonal system
    band = np.array([np.ones(len(left) + 1), np.append(-left, 0.0)])
    states, _ = dtbtrs(band, np.append(start, (1.0 - left) * goals), uplo="L", diag="U")
    return np.asarray(states[:, 0] if states.ndim > 1 else states)


class WarmLaw(NamedTuple):
    """Friction law at its mean warmth: coefficients, covariance, dependence on warmth."""

    values: Array
    covariance: Array
    warmth: Warmth


def find_warmth(levels: Blocks, time: Array, past: History, axis: int) -> WarmLaw | None:
    """Fit the law with warmth; return None unless warmth improves the prediction.

    Parameters
    ----------
    levels : Blocks
        One channel with the terms of the law, one group for each measurement, in order of time.
    time : ndarray, shape (n,)
        Middle of each measurement, ascending [s].
    axis : int
        Axis from 0.
    """
    # with a smaller range of warmth the slope would be extrapolated more than twentyfold
    courses = {
        taus: course
        for taus in product(*TIMES)
        if np.ptp(course := warmth_at(past, axis, *taus, time)) > 0.05
    }
    if len(time) < FOLDS or not courses:
        return None
    # squared errors of held-out parts, (3, n_parts): of the law alone, of the level of the last
    # measurement before, and of warmth
    errors = []
    for out in folds(len(levels)):
        kept = np.ones(len(levels), dtype=bool)
        kept[out] = False
        rest, held = levels.where(kept), levels.where(~kept)
        taus = _best(rest, {each: course[kept] for each, course in courses.items()})
        warm = _fitted(rest, courses[taus][kept], STEPS)
        alone, same = _fitted(rest, np.zeros(len(rest)), 1).values, np.ones(len(held))
        last = 1.0 + deviations(rest, alone)[max(out.start - 1, 0)]
        tried = (alone, same), (alone, last * same), (warm.values, warm.factors(courses[taus][out]))
        errors.append([squared_errors(held, *each).sum() for each in tried])
    law, last, warm = np.transpose(errors)
    if simplest({"law": law, "warmth": warm}) == "law" or last.sum() <= warm.sum():
        return None
    taus = _best(levels, courses)
    fit, warmth = _fitted(levels, courses[taus], STEPS), courses[taus]
    factors = fit.factors(warmth)
    covariance = fit.regression.uncertainty("clusters").covariance
    if fit.slope >= 0.0 or factors.min() <= 0.0:  # warmth reduces friction, but not to zero
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
    """Return the relative deviation of each measurement's level from the law, shape (n,)."""
    products = levels.products[:, 0]
    directed = np.concatenate([[0.0], np.where(np.isin(levels.own, DIRECTED), values, 0.0)])
    left = np.concatenate([[1.0], -values])
    level = np.einsum("k,nkl,l->n", directed, products, directed)
    return np.asarray((products @ left @ directed) / np.where(level > 0, level, np.inf))


def lost_degrees(levels: Blocks, values: Array) -> float:
    """Return the degrees of freedom of `deviations` lost to the law fitted to the same samples.

    A change of a measurement's level moves the coefficients, which take the share l' N^-1 l / l' a
    of the change, with the normal matrix N of all measurements and the products l of the
    measurement's columns with its level. The sum over the measurements is 1 for measurements with
    equal speeds, and at most the number of terms.
    """
    products = levels.products[:, 0, 1:, 1:]
    level = np.where(np.isin(levels.own, DIRECTED), values, 0.0)
    own = products @ level
    squares, taken = own @ level, own * solved(products.sum(axis=0), own.T).T
    return float(np.sum(taken.sum(axis=1)[squares > 0] / squares[squares > 0]))


class _Fit(NamedTuple):
    """Fitted law at the mean warmth `reference`, with relative slope and regression."""

    values: Array
    slope: float
    reference: float
    regression: Regression

    def factors(self, warmth: Array) -> Array:
        return 1.0 + self.slope * (warmth - self.reference)


def _fitted(levels: Blocks, warmth: Array, steps: int) -> _Fit:
    """Fit law and slope for given warmth by Gauss-Newton steps; no slope for constant warmth."""
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


def squared_errors(levels: Blocks, values: Array, factors: Array) -> Array:
    """Return the squared error of each measurement with scaled levels of the law, shape (n,)."""
    scaled = np.where(np.isin(levels.own, DIRECTED), factors[:, np.newaxis], 1.0) * values
    around = np.column_stack([np.ones(len(scaled)), -scaled])
    squares: Array = np.einsum("nk,nkl,nl->n", around, levels.products[:, 0], around)
    return squares.clip(0.0)


def _best(levels: Blocks, courses: dict[tuple[float, float], Array]) -> tuple[float, float]:
    """Return the time constants with the smallest residual after two Gauss-Newton steps.

    All candidates are computed at once, since the normal equations are sums over measurements of
    inner products times powers of warmth.
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
