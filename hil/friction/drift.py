"""Time constants of temperature and lubricant, from friction levels over time.

A friction level f_k measured at time t_k is modelled as

    ln f_k = c + alpha T(t_k) + beta S(t_k) + e_k

with two states, driven by the history of the axis. T is the warmth of the gear and follows the
speed (friction power at nearly constant friction) with one time constant. S is the settled share of
the lubricant: S grows at rest with a second time constant and decays in motion with a third one, at
a rate proportional to the speed:

    T' = (x - T) / tau_warm,    S' = (1 - S) / tau_rest at rest,    S' = -S (x / x0) / tau_motion,

with the mean speed x as a share of the limit and x0 = `REFERENCE`. The axis counts as cold and
rested when the run begins. Each kind and speed of levels has its own constant c. For given time
constants the model is linear. A grid over the logarithms of the time constants, refined by bounded
least squares, yields the time constants. Residuals are autocorrelated, which widens the standard
errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.friction.warmth import REFERENCE, relaxed
from hil.least_squares.solving import fitted, solve_each
from hil.least_squares.uncertainty import UNCERTAIN, classical

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.friction.warmth import History


AT_REST = 0.01
"""Mean speed below which the lubricant settles, as a share of the limit: the mean speed of a travel
between two recordings.
"""
BOUNDS = {"warm-up": (120.0, 14400.0), "settling": (10.0, 3600.0), "stirring": (1.0, 600.0)}
"""Bounds of the time constants, from the duration of a measurement to that of a shift [s]."""
GRID = (6, 5, 5)
"""Grid points of each time constant, about a factor of two apart."""
FEWEST = 10
"""Minimum number of levels beyond the number of unknowns: with fewer, the scatter is uncertain by a
quarter or more, 1 / sqrt(2 * 10).
"""


class Level(NamedTuple):
    """A friction level at an instant.

    Attributes
    ----------
    time : float
        Instant of the level [s].
    friction : float
        Friction level, positive [N m].
    group : str
        Kind and speed; levels of different groups are not compared.
    """

    time: float
    friction: float
    group: str


class TimeConstant(NamedTuple):
    """Time constant of a drift, with its standard error.

    Attributes
    ----------
    name : str
        Name: warm-up, settling or stirring.
    value, standard_error : float
        Value and standard error [s].
    word : str
        Reason if the time constant is not identifiable; empty otherwise.
    """

    name: str
    value: float
    standard_error: float
    word: str


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """Drift of an axis's friction over time.

    Attributes
    ----------
    axis : int
        Axis from 0.
    levels : tuple of Level
        Fitted levels.
    fitted : ndarray, shape (n,)
        Levels of the model [N m].
    warm_effect, rest_effect : float
        Relative change of the level by the observed warming, and from stirred to settled lubricant.
    scatter : float
        Relative root mean square of the residuals.
    """

    axis: int
    levels: tuple[Level, ...]
    fitted: Array
    constants: tuple[TimeConstant, ...]
    warm_effect: float
    rest_effect: float
    scatter: float


def drift(axis: int, levels: Sequence[Level], past: History) -> Drift | None:
    """Estimate the time constants of an axis; None if the number of levels is too small."""
    used = sorted(levels, key=lambda level: level.time)
    names = sorted({level.group for level in used})
    if len(used) < FEWEST + len(names) + 5:
        return None
    log_levels = np.log([level.friction for level in used])
    course = _Course(axis, used, names, past)
    low, high = np.log(list(BOUNDS.values())).T

    def left(taus: Array) -> Array:
        X = course.columns(taus)
        return np.asarray(log_levels - X @ fitted(X, log_levels))

    grid = [np.linspace(a, b, n + 2)[1:-1] for a, b, n in zip(low, high, GRID, strict=True)]
    start = course.best(grid, log_levels)
    from scipy.optimize import least_squares  # noqa: PLC0415 - takes long to load

    taus = np.asarray(least_squares(left, start, bounds=(low, high)).x)
    X, residual = course.columns(taus), left(taus)
    a = fitted(X, log_levels)
    jacobian = np.column_stack([X, *(column @ a[-2:] for column in course.changes(taus))])
    variance = float(residual @ residual) / (len(residual) - jacobian.shape[1])
    # factor of variances by the first-order autocorrelation of the residuals
    rho = float(residual[1:] @ residual[:-1] / (residual @ residual)) if residual.any() else 0.0
    rho = min(max(rho, 0.0), 0.95)
    covariance = classical(jacobian, variance * ((1.0 + rho) / (1.0 - rho)))
    error = np.sqrt(np.diag(covariance))
    seen = UNCERTAIN * np.abs(a[-2:]) > error[len(a) - 2 : len(a)]
    at_bound = np.minimum(taus - low, high - taus) < 1e-3
    rows = zip(BOUNDS, taus, error[len(a) :], seen[[0, 1, 1]], at_bound, strict=True)
    return Drift(
        axis=axis,
        levels=tuple(used),
        fitted=np.exp(log_levels - residual),
        constants=tuple(_constant(*row) for row in rows),
        warm_effect=float(np.exp(a[-2] * X[:, -2].max()) - 1.0),
        rest_effect=float(np.exp(a[-1]) - 1.0),
        scatter=float(np.sqrt(np.mean(residual**2))),
    )


class _Course:
    """Columns of the regression of an axis's levels on the states of the axis."""

    def __init__(
        self, axis: int, levels: Sequence[Level], names: Sequence[str], past: History
    ) -> None:
        self._time = np.array([level.time for level in levels])
        self._constants = np.array([[float(k.group == name) for name in names] for k in levels])
        self._ends, self._speed = np.append(past.begin, past.end), past.speed[:, axis]

    def columns(self, taus: Array) -> Array:
        """Return columns of group constants, warmth and settled share for log time constants."""
        warm_up, settling, stirring = np.exp(taus)
        states = self._warmth(warm_up), self._settled(settling, stirring)
        return np.column_stack([self._constants, *states])

    def best(self, grid: Sequence[Array], log_levels: Array) -> Array:
        """Return the logarithms of the time constants of the grid with the smallest residual."""
        warm_up, settling, stirring = (np.exp(each) for each in grid)
        warmth = [self._warmth(tau) for tau in warm_up]
        settled = [self._settled(*taus) for taus in product(settling, stirring)]
        pairs = np.array(list(product(warmth, settled)))
        constants = np.broadcast_to(self._constants.T, (len(pairs), *self._constants.T.shape))
        X = np.concatenate([constants, pairs], axis=1)
        left = log_levels - (solve_each(X @ X.swapaxes(1, 2), X @ log_levels)[:, np.newaxis] @ X)
        return np.asarray(list(product(*grid))[int(np.argmin(np.sum(left**2, axis=(1, 2))))])

    def _warmth(self, tau: float) -> Array:
        left = np.exp(-np.diff(self._ends) / tau)
        return np.asarray(np.interp(self._time, self._ends, relaxed(0.0, self._speed, left)))

    def _settled(self, settling: float, stirring: float) -> Array:
        resting = self._speed < AT_REST
        rate = np.where(resting, 1.0 / settling, self._speed / REFERENCE / stirring)
        left = np.exp(-np.diff(self._ends) * rate)
        return np.asarray(np.interp(self._time, self._ends, relaxed(1.0, resting, left)))

    def changes(self, taus: Array, step: float = 1e-3) -> list[Array]:
        """Return derivatives of warmth and settled share by `taus`: arrays of shape (n, 2)."""
        return [
            (self.columns(taus + d) - self.columns(taus - d))[:, -2:] / (2 * step)
            for d in step * np.eye(len(taus))
        ]


def _constant(name: str, tau: float, error: float, seen: bool, at_bound: bool) -> TimeConstant:
    """Return the time constant exp(`tau`), with the reason if not identifiable."""
    value, word = float(np.exp(tau)), ""
    if not seen:
        word = "effect below the scatter; measure longer, or with stops"
    elif at_bound:
        word = f"at its bound, {value:.0f} s; no such change in this run"
    elif error > UNCERTAIN:
        by = f"uncertain by {100 * error:.0f} %" if np.isfinite(error) else "not excited"
        word = f"{by}; measure longer, or with more stops"
    return TimeConstant(name, value, value * float(error), word)
