"""Time constants of temperature and lubricant, from friction levels over time.

A friction level f_k measured at time t_k is modelled as

    ln f_k = c + alpha T(t_k) + beta S(t_k) + e_k

with two states that the axis's own history drives. T is the warmth of the gear, which follows the
speed (friction power, at much the same friction) with one time constant; S is the share of the
lubricant that has settled, which grows at rest with a second one and decays in motion with a third,
at a rate proportional to the speed:

    T' = (x - T) / tau_warm,    S' = (1 - S) / tau_rest at rest,    S' = -S (x / x0) / tau_motion,

x being the mean speed as a share of the limit and x0 = `REFERENCE`. The axis counts as cold and
rested when the run begins. Levels of different kinds or speeds have constants c of their own. Given
the time constants all else is linear; they are looked for on a grid in their logarithms and refined
by bounded least squares. Residuals wander, so standard errors are widened by their autocorrelation.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.friction.warmth import REFERENCE, relaxed
from hil.least_squares.solving import fitted
from hil.least_squares.uncertainty import classical

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.friction.history import History

    Array = NDArray[np.float64]

AT_REST = 0.01
"""Mean speed, as share of the limit, below which the lubricant settles."""
BOUNDS = {"warm-up": (120.0, 14400.0), "settling": (10.0, 3600.0), "stirring": (1.0, 600.0)}
"""Time constants that are looked for [s]."""
GRID = (6, 5, 5)
UNCERTAIN = 0.5
"""Relative standard error from which on a time constant is not identifiable."""
SMALL = 2.0
"""Effect over its standard error below which it identifies no time constant."""
FEWEST = 10
"""Levels beyond the number of unknowns that a fit needs."""
ALONE = 3
"""Levels of one kind and speed that make it count."""


@dataclass(frozen=True, slots=True)
class Level:
    """A friction level at an instant.

    Attributes
    ----------
    time : float
        [s].
    friction : float
        Positive [N m].
    group : str
        Kind and speed; levels of different groups are not compared.
    """

    time: float
    friction: float
    group: str


@dataclass(frozen=True, slots=True)
class TimeConstant:
    """One of the three.

    Attributes
    ----------
    name : str
        warm-up, settling or stirring.
    value, standard_error : float
        [s].
    word : str
        Why it is not identifiable; empty where it is.
    """

    name: str
    value: float
    standard_error: float
    word: str


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """The variance in time of one axis's friction.

    Attributes
    ----------
    axis : int
        From 0.
    levels : tuple of Level
        What was fitted.
    fitted : ndarray, shape (n,)
        The same by the model [N m].
    constants : tuple of TimeConstant
    warm_effect, rest_effect : float
        Relative change of the level by warming up as far as it did, and from stirred to settled.
    scatter : float
        Relative root mean square of what is left.
    """

    axis: int
    levels: tuple[Level, ...]
    fitted: Array
    constants: tuple[TimeConstant, ...]
    warm_effect: float
    rest_effect: float
    scatter: float


def drift(axis: int, levels: Sequence[Level], past: History) -> Drift | None:
    """Estimate the time constants of one axis; None where there are too few levels."""
    groups = [level.group for level in levels]
    used = sorted((k for k in levels if groups.count(k.group) >= ALONE), key=lambda k: k.time)
    names = sorted({level.group for level in used})
    if len(used) < FEWEST + len(names) + 5:
        return None
    fit = _Fit(axis, used, names, past)
    found = fit.best()
    return fit.result(found)


class _Fit:
    """Levels of one axis with its history."""

    def __init__(
        self, axis: int, levels: Sequence[Level], names: Sequence[str], past: History
    ) -> None:
        self._axis = axis
        self._levels = tuple(levels)
        self._time = np.array([level.time for level in levels])
        self._y = np.log([level.friction for level in levels])
        self._constants = np.array([[float(k.group == name) for name in names] for k in levels])
        self._ends, self._speed = past.end, past.speed[:, axis]
        self._begin = past.begin
        bounds = np.log(list(BOUNDS.values()))
        self._low, self._high = bounds[:, 0], bounds[:, 1]

    def best(self) -> Array:
        """Logarithms of the time constants, shape (3,)."""
        grid = [np.linspace(a, b, n + 2)[1:-1] for a, b, n in
                zip(self._low, self._high, GRID, strict=True)]  # fmt: skip
        start = min(product(*grid), key=lambda taus: float(np.sum(self._left(np.array(taus)) ** 2)))
        from scipy.optimize import least_squares  # noqa: PLC0415 - takes long to load

        refined = least_squares(self._left, np.array(start), bounds=(self._low, self._high))
        return np.asarray(refined.x, dtype=np.float64)

    def result(self, taus: Array) -> Drift:
        """All that the fit says."""
        X, a, left = self._solve(taus)
        spare = len(left) - X.shape[1] - len(taus)
        covariance = self._covariance(taus, X, float(left @ left) / spare * _wandering(left))
        error = np.sqrt(np.diag(covariance))
        warm, rest = float(a[-2]), float(a[-1])
        n = len(a)
        significant = np.abs(a[-2:]) > SMALL * error[n - 2 : n]
        shown = (significant[0], significant[1], significant[1])
        constants = tuple(
            self._constant(k, name, taus[k], float(error[n + k]), seen=bool(shown[k]))
            for k, name in enumerate(BOUNDS)
        )
        return Drift(
            axis=self._axis,
            levels=self._levels,
            fitted=np.asarray(np.exp(self._y - left), dtype=np.float64),
            constants=constants,
            warm_effect=float(np.exp(warm * X[:, -2].max()) - 1.0),
            rest_effect=float(np.exp(rest) - 1.0),
            scatter=float(np.sqrt(np.mean(left**2))),
        )

    def _constant(
        self, k: int, name: str, log_tau: float, error: float, *, seen: bool
    ) -> TimeConstant:
        value = float(np.exp(log_tau))
        word = ""
        if not seen:
            word = "its effect is lost in the scatter; measure longer, or with stops"
        elif min(log_tau - self._low[k], self._high[k] - log_tau) < 1e-3:
            word = f"at its bound, {value:.0f} s; the run holds no such change"
        elif error > UNCERTAIN:
            by = f"uncertain by {100 * error:.0f} %" if np.isfinite(error) else "not excited"
            word = f"{by}; measure longer, or with more stops"
        return TimeConstant(name, value, value * error, word)

    def _states(self, taus: Array) -> Array:
        """Warmth and settled share at the times of the levels, shape (n, 2)."""
        warm_up, settling, stirring = np.exp(taus)
        ends = np.append(self._begin, self._ends)
        spans, x = np.diff(ends), self._speed
        resting = x < AT_REST
        rate = np.where(resting, 1.0 / settling, x / REFERENCE / stirring)
        warmth = relaxed(0.0, x, np.exp(-spans / warm_up))
        settled = relaxed(1.0, resting, np.exp(-spans * rate))
        return np.column_stack([np.interp(self._time, ends, s) for s in (warmth, settled)])

    def _solve(self, taus: Array) -> tuple[Array, Array, Array]:
        """Columns, coefficients and residuals for given time constants."""
        X = np.column_stack([self._constants, self._states(taus)])
        a = fitted(X, self._y)
        return X, a, self._y - X @ a

    def _left(self, taus: Array) -> Array:
        return self._solve(taus)[2]

    def _covariance(self, taus: Array, X: Array, variance: float) -> Array:
        """Of linear coefficients and logarithms of time constants, by the whole Jacobian."""
        a = self._solve(taus)[1][-2:]
        step = 1e-3
        by_tau = [
            (self._states(taus + d) - self._states(taus - d)) @ a / (2 * step)
            for d in step * np.eye(len(taus))
        ]
        return classical(np.column_stack([X, *by_tau]), variance)


def _wandering(left: Array) -> float:
    """How much the autocorrelation of residuals widens the variance of what is fitted to them."""
    rho = float(left[1:] @ left[:-1] / (left @ left)) if left.any() else 0.0
    rho = min(max(rho, 0.0), 0.95)
    return (1.0 + rho) / (1.0 - rho)
