"""Friction models as functions of speed, fitted to measured points.

=========== ================================================= =============================
linear      a1 v + a2 sgn v                                   eq. (1), linear least squares
cube-root   a1 v + a2 sgn v + a3 cbrt v                       eq. (2), linear least squares
arctan      a1 v + a2 sgn v + a3 atan(a4 v)                   eq. (3), bounded non-linear
stribeck    a1 v + a2 sgn v + a3 exp(-(v / a4)^2) sgn v       bounded non-linear
=========== ================================================= =============================

Given a4 the last two are linear as well. So a4 is looked for on a grid in its logarithm, all else
by linear least squares (variable projection, Golub and Pereyra 1973), and the best start is refined
by bounded non-linear least squares over all four. In the fit speed is a share of the axis's limit
and torque a share of the largest one measured, so that all parameters are of similar size.

A parameter is not identifiable where a4 ends at its bound (its knee lies outside the measured
speeds) or has a standard error of more than half its value, or where another one has and is
correlated with a further one so strongly that only both together are known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.least_squares.solving import fitted
from hil.least_squares.uncertainty import classical, correlation_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

Law = Literal["linear", "cube-root", "arctan", "stribeck"]
LAWS: tuple[Law, ...] = ("linear", "cube-root", "arctan", "stribeck")
"""From the simplest."""
GRID = 60
"""Values of a4 that are tried first."""
UNCERTAIN = 0.5
"""Standard error over value from which on a parameter may count as not identifiable."""
TIED = 0.95
"""Correlation with another parameter from which on both are only known together."""
UNIT: dict[Law, tuple[str, ...]] = {
    "linear": ("N m s/rad", "N m"),
    "cube-root": ("N m s/rad", "N m", "N m (s/rad)^1/3"),
    "arctan": ("N m s/rad", "N m", "N m", "s/rad"),
    "stribeck": ("N m s/rad", "N m", "N m", "rad/s"),
}
"""Of an axis that turns; `units` has those of any."""


@dataclass(frozen=True, slots=True, eq=False)
class FrictionModel:
    """A fitted friction model of one axis.

    Attributes
    ----------
    kind : str
        One of `LAWS`.
    a : ndarray, shape (n_parameters,)
        Parameters in SI, units by `units`.
    standard_error : ndarray, shape (n_parameters,)
        From the scatter about the model; NaN where there are no degrees of freedom or the data do
        not determine the parameter.
    mean_square : float
        Mean quadratic error of the fit [N^2 m^2].
    unidentifiable : tuple of str
        A sentence for every parameter that the data do not identify.
    """

    kind: Law
    a: Array
    standard_error: Array
    mean_square: float
    unidentifiable: tuple[str, ...]

    def torque(self, v: ArrayLike) -> Array:
        """Friction torque against motions at velocities `v` (any shape) [rad/s -> N m]."""
        return torque(self.kind, self.a, v)


def torque(kind: Law, a: ArrayLike, v: ArrayLike) -> Array:
    """Friction torque of a model with parameters `a` at velocities `v` [rad/s -> N m]."""
    coefficients, velocity = np.asarray(a, dtype=float), np.asarray(v, dtype=float)
    shape = coefficients[3] if len(coefficients) > 3 else 1.0
    value: Array = _columns(kind, velocity, shape) @ coefficients[:3]
    return value


def fit_model(kind: Law, v: Array, tau: Array, limit: float) -> FrictionModel:
    """Fit one model.

    Parameters
    ----------
    v, tau : ndarray, shape (n,)
        Velocities [rad/s] and friction torques [N m]; at least as many as parameters.
    limit : float
        The axis's speed limit, which scales the fit [rad/s].
    """
    scale = float(np.abs(tau).max())
    x, y = v / limit, tau / scale
    bounds = _bounds(kind, np.abs(x))
    a = _linear(kind, x, y, 1.0) if bounds is None else _non_linear(kind, x, y, bounds)
    left = y - torque(kind, a, x)
    covariance = _covariance(kind, a, x, left)
    words = _words(a, covariance, bounds)
    back = scale / limit ** _powers(kind)
    if bounds is not None:
        back[3] = limit if kind == "stribeck" else 1.0 / limit
    error = np.sqrt(np.diag(covariance)) * back
    error[np.isinf(error)] = np.nan
    return FrictionModel(kind, a * back, error, float(np.mean(left**2)) * scale**2, words)


def units(kind: Law, *, turns: bool) -> tuple[str, ...]:
    """Units of a model's parameters, for an axis that turns or one that slides."""
    if turns:
        return UNIT[kind]
    return tuple(unit.replace("N m", "N").replace("rad", "m") for unit in UNIT[kind])


def n_parameters(kind: Law) -> int:
    """Parameters of a model."""
    return len(UNIT[kind])


def _powers(kind: Law) -> Array:
    """Powers of the speed that scale each parameter."""
    return {
        "linear": np.array([1.0, 0.0]),
        "cube-root": np.array([1.0, 0.0, 1 / 3]),
    }.get(kind, np.array([1.0, 0.0, 0.0, 0.0]))


def _columns(kind: Law, v: Array, shape: float) -> Array:
    """What the linear parameters are multiplied with, shape (..., 2 or 3)."""
    columns = [v, np.sign(v)]
    if kind == "cube-root":
        columns.append(np.cbrt(v))
    elif kind == "arctan":
        columns.append(np.arctan(shape * v))
    elif kind == "stribeck":
        columns.append(np.exp(-((v / shape) ** 2)) * np.sign(v))
    return np.stack(columns, axis=-1)


def _bounds(kind: Law, speed: Array) -> tuple[float, float] | None:
    """Range of a4 in which the knee lies among the measured speeds; None for linear models."""
    low, high = float(speed.min()), float(speed.max())
    if kind == "arctan":
        return 0.5 / high, 2.0 / low
    return (0.5 * low, high) if kind == "stribeck" else None


def _linear(kind: Law, x: Array, y: Array, shape: float) -> Array:
    return fitted(_columns(kind, x, shape), y)


def _non_linear(kind: Law, x: Array, y: Array, bounds: tuple[float, float]) -> Array:
    def start(shape: float) -> Array:
        return np.append(_linear(kind, x, y, shape), shape)

    def error(a: Array) -> float:
        return float(np.sum((y - torque(kind, a, x)) ** 2))

    best = min((start(shape) for shape in np.geomspace(*bounds, GRID)), key=error)
    low, high = np.full(4, -np.inf), np.full(4, np.inf)
    low[3], high[3] = bounds
    inside = np.append(best[:3], np.clip(best[3], low[3] * (1 + 1e-9), high[3] * (1 - 1e-9)))

    def residual(a: Array) -> Array:
        return torque(kind, a, x) - y

    def jacobian(a: Array) -> Array:
        return _jacobian(kind, a, x)

    from scipy.optimize import least_squares  # noqa: PLC0415 - takes long to load

    refined = least_squares(residual, inside, jacobian, bounds=(low, high), x_scale="jac")
    found: Array = refined.x
    return found if error(found) < error(best) else best


def _jacobian(kind: Law, a: Array, x: Array) -> Array:
    """Change of the torque per change of each parameter, shape (n, n_parameters)."""
    if len(a) < 4:
        return _columns(kind, x, 1.0)
    if kind == "arctan":
        by_shape = a[2] * x / (1.0 + (a[3] * x) ** 2)
    else:
        bell = np.exp(-((x / a[3]) ** 2)) * np.sign(x)
        by_shape = a[2] * bell * 2.0 * x**2 / a[3] ** 3
    return np.column_stack([_columns(kind, x, a[3]), by_shape])


def _covariance(kind: Law, a: Array, x: Array, left: Array) -> Array:
    spare = len(x) - len(a)
    variance = float(left @ left) / spare if spare > 0 else np.nan
    return classical(_jacobian(kind, a, x), variance)


def _words(a: Array, covariance: Array, bounds: tuple[float, float] | None) -> tuple[str, ...]:
    """State which parameters the data do not identify, and why."""
    found = []
    error = np.sqrt(np.diag(covariance))
    correlated = correlation_of(covariance)
    if bounds is not None and (a[3] < bounds[0] * 1.001 or a[3] > bounds[1] * 0.999):
        found.append("a3, a4: the knee lies outside the measured speeds; only their sum is known")
        return tuple(found)
    found += [f"a{k + 1}: the data do not determine it" for k in np.flatnonzero(np.isinf(error))]
    if bounds is not None and UNCERTAIN * a[3] < error[3] < np.inf:
        found.append(
            f"a4: standard error {100 * error[3] / a[3]:.0f} % of its value, nor a3 for sure"
        )
    for k in np.flatnonzero(error[:3] > UNCERTAIN * np.abs(a[:3])):
        others = np.abs(np.delete(correlated[k], k))
        if len(others) and others.max() > TIED:
            partner = int(np.argmax(np.abs(correlated[k]) * (np.arange(len(a)) != k)))
            found.append(
                f"a{k + 1}: standard error {100 * error[k] / max(abs(a[k]), 1e-300):.0f} % of its"
                f" value, correlation {correlated[k, partner]:.2f} with a{partner + 1}: known"
                " together only"
            )
    return tuple(found)
