"""Friction as a function of speed: four models, fitted to measured points and selected.

=========== ================================================= =============================
linear      a1 v + a2 sgn v                                   eq. (1), linear least squares
cube-root   a1 v + a2 sgn v + a3 cbrt v                       eq. (2), linear least squares
arctan      a1 v + a2 sgn v + a3 atan(a4 v)                   eq. (3), bounded non-linear
stribeck    a1 v + a2 sgn v + a3 exp(-(v / a4)^2) sgn v       bounded non-linear
=========== ================================================= =============================

All models are odd functions of velocity. Least squares over both directions is therefore least
squares over the mean of both directions, to which the models are fitted. Asymmetric friction is
tested separately (`hil.estimation.friction.points`).

For given a4, the last two models are linear as well. A grid over log a4, refined between the best
neighbours, yields a4; linear least squares yields all other parameters (variable projection, Golub
and Pereyra 1973). The fit uses speed as a share of the axis's limit and torque as a share of the
largest measured torque, so that all parameters have similar sizes.

A parameter is not identifiable if a4 ends at its bound (the knee is outside the measured speeds),
if its standard error exceeds half its value, or if it is so strongly correlated with another
parameter that only their sum is known.

The recommended model is the simplest one that no other model beats by more than chance at held-out
speeds, all repetitions of a speed together (`hil.least_squares.choice`). The slowest and the
fastest speed are never held out, since models are not used beyond the measured speeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from checked_files.yaml_file import FileModel
from hil.least_squares.choice import simplest
from hil.least_squares.solving import fitted
from hil.least_squares.uncertainty import UNCERTAIN, classical, correlation_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from hil.arrays import Array


Law = Literal["linear", "cube-root", "arctan", "stribeck"]
_FAMILIES: dict[Law, tuple[tuple[str, ...], tuple[float, ...]]] = {
    "linear": (("N m s/rad", "N m"), (1.0, 0.0)),
    "cube-root": (("N m s/rad", "N m", "N m (s/rad)^1/3"), (1.0, 0.0, 1 / 3)),
    "arctan": (("N m s/rad", "N m", "N m", "s/rad"), (1.0, 0.0, 0.0, 1.0)),
    "stribeck": (("N m s/rad", "N m", "N m", "rad/s"), (1.0, 0.0, 0.0, -1.0)),
}
"""Units of each model's parameters for a revolute axis, and powers of the inverse speed in these
units; the simplest model first."""
LAWS: tuple[Law, ...] = tuple(_FAMILIES)
GRID = 60
"""Number of grid points of a4: steps of a tenth over the 2.5 decades of a sweep's speeds."""


class FrictionModel(FileModel):
    """Fitted friction model of an axis; an entry of `friction.yaml`.

    Attributes
    ----------
    kind : str
        One of `LAWS`.
    a : tuple of float
        Parameters in SI.
    standard_error : tuple of float or None
        Standard errors from the scatter about the model; None without degrees of freedom, and for
        undetermined parameters.
    units : tuple of str
        Units of `a`.
    error : float
        Root mean square of the residuals [N m or N].
    held_out_error : float, optional
        Root mean square error at held-out speeds [N m or N].
    unidentifiable : tuple of str
        One sentence for each parameter not identified by the data.
    """

    kind: Law
    a: tuple[float, ...]
    standard_error: tuple[float | None, ...]
    units: tuple[str, ...]
    error: float
    held_out_error: float | None = None
    unidentifiable: tuple[str, ...]

    def torque(self, v: ArrayLike) -> Array:
        """Return the friction torque at velocities `v`, any shape [rad/s -> N m]."""
        return torque(self.kind, self.a, v)


@dataclass(frozen=True, slots=True, eq=False)
class AxisCurves:
    """Friction models of an axis, fitted over speed.

    Attributes
    ----------
    axis : int
        Axis from 0.
    velocity, torque : ndarray, shape (n,)
        Fitted points: speeds [rad/s], mean friction of both directions [N m].
    models : dict
        Models by kind, where the number of speeds allows a fit.
    chosen : str
        Kind of the recommended model.
    """

    axis: int
    velocity: Array
    torque: Array
    models: dict[Law, FrictionModel]
    chosen: Law


def choose(
    axis: int, velocity: Array, torque: Array, limit: float, *, turns: bool = True
) -> AxisCurves | None:
    """Fit all friction models to the points of an axis and select a model.

    Parameters
    ----------
    axis : int
        Axis from 0.
    velocity, torque : ndarray, shape (n,)
        Positive speeds [rad/s], mean friction of both directions [N m].
    limit : float
        The axis's speed limit [rad/s].
    turns : bool
        True for a revolute axis; units of a prismatic axis are m and N.

    Returns
    -------
    AxisCurves or None
        None with less than three speeds, which allow no check of a model.
    """
    order = np.argsort(velocity)
    speed = np.empty(len(velocity), dtype=np.intp)
    # drives hold their speed within 2 %, so closer points belong to one speed
    speed[order] = np.cumsum(np.diff(np.log(velocity[order]), prepend=-np.inf) > 0.02) - 1
    kinds = [kind for kind in LAWS if speed.max() + 1 > len(_FAMILIES[kind][0])]
    if not kinds:
        return None
    errors: dict[str, Array] = {}
    models = {}
    for kind in kinds:
        squares = []
        for out in (speed == number for number in range(1, speed.max())):
            model = fit_model(kind, velocity[~out], torque[~out], limit)
            squares.append(float(np.mean((torque[out] - model.torque(velocity[out])) ** 2)))
        errors[kind] = np.array(squares)
        held_out = float(np.sqrt(errors[kind].mean()))
        fit = fit_model(kind, velocity, torque, limit, turns=turns)
        models[kind] = fit.model_copy(update={"held_out_error": held_out})
    best = simplest(errors)
    return AxisCurves(axis, velocity, torque, models, next(k for k in kinds if k == best))


def torque(kind: Law, a: ArrayLike, v: ArrayLike) -> Array:
    """Return the friction torque of a model with parameters `a` at velocities `v` [N m]."""
    coefficients, velocity = np.asarray(a, dtype=float), np.asarray(v, dtype=float)
    shape = coefficients[3] if len(coefficients) > 3 else 1.0
    value: Array = _columns(kind, velocity, shape) @ coefficients[:3]
    return value


def fit_model(
    kind: Law, v: Array, tau: Array, limit: float, *, turns: bool = True
) -> FrictionModel:
    """Fit a friction model to points.

    Parameters
    ----------
    v, tau : ndarray, shape (n,)
        Velocities [rad/s] and friction torques [N m]; at least as many as parameters.
    limit : float
        Speed limit of the axis, which scales the fit [rad/s].
    turns : bool
        True for a revolute axis; units of a prismatic axis are m and N.
    """
    names, powers = _FAMILIES[kind]
    scale = float(np.abs(tau).max())
    x, y = v / limit, tau / scale
    bounds = _bounds(kind, np.abs(x))
    shape = () if bounds is None else (_shape(kind, x, y, bounds),)
    a = np.array([*fitted(_columns(kind, x, *shape), y), *shape])
    left, spare = y - torque(kind, a, x), len(x) - len(a)
    variance = float(left @ left) / spare if spare > 0 else np.nan
    covariance = classical(_jacobian(kind, a, x), variance)
    back = np.array([scale, scale, scale, 1.0])[: len(a)] / limit ** np.array(powers)
    error = np.sqrt(np.diag(covariance)) * back
    return FrictionModel(
        kind=kind,
        a=tuple((a * back).tolist()),
        standard_error=tuple(float(e) if np.isfinite(e) else None for e in error),
        units=names if turns else tuple(sliding(unit) for unit in names),
        error=float(np.sqrt(np.mean(left**2))) * scale,
        unidentifiable=_words(a, covariance, bounds),
    )


def sliding(unit: str) -> str:
    """Convert a unit of a revolute axis to the unit of a prismatic axis."""
    return unit.replace("N m", "N").replace("rad", "m")


def _columns(kind: Law, v: Array, shape: float = 1.0) -> Array:
    """Return the regressor of the linear parameters, shape (..., 2 or 3)."""
    columns = [v, np.sign(v)]
    if kind == "cube-root":
        columns.append(np.cbrt(v))
    elif kind == "arctan":
        columns.append(np.arctan(shape * v))
    elif kind == "stribeck":
        columns.append(np.exp(-((v / shape) ** 2)) * np.sign(v))
    return np.stack(columns, axis=-1)


def _jacobian(kind: Law, a: Array, x: Array) -> Array:
    """Return the derivatives of the torque with respect to the parameters, (n, n_parameters)."""
    if len(a) < 4:
        return _columns(kind, x)
    if kind == "arctan":
        by_shape = a[2] * x / (1.0 + (a[3] * x) ** 2)
    else:
        bell = np.exp(-((x / a[3]) ** 2)) * np.sign(x)
        by_shape = a[2] * bell * 2.0 * x**2 / a[3] ** 3
    return np.column_stack([_columns(kind, x, a[3]), by_shape])


def _bounds(kind: Law, speed: Array) -> tuple[float, float] | None:
    """Return the range of a4 with the knee among the measured speeds; None for linear models."""
    low, high = float(speed.min()), float(speed.max())
    if kind == "arctan":
        return 0.5 / high, 2.0 / low
    return (0.5 * low, high) if kind == "stribeck" else None


def _shape(kind: Law, x: Array, y: Array, bounds: tuple[float, float]) -> float:
    """Find a4 by variable projection: the smallest residual with fitted linear parameters."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - takes long to load

    def left(logarithm: float) -> float:
        W = _columns(kind, x, float(np.exp(logarithm)))
        return float(np.sum((y - W @ fitted(W, y)) ** 2))

    grid = np.log(np.geomspace(*bounds, GRID))
    best = int(np.argmin([left(each) for each in grid]))
    ends = grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)]
    refined = minimize_scalar(left, bounds=ends, method="bounded", options={"xatol": 1e-9})
    return float(np.exp(min(grid[best], float(refined.x), key=left)))


def _words(a: Array, covariance: Array, bounds: tuple[float, float] | None) -> tuple[str, ...]:
    """State which parameters the data do not identify, and why."""
    found = []
    error = np.sqrt(np.diag(covariance))
    correlated = correlation_of(covariance)
    if bounds is not None and (a[3] < bounds[0] * 1.001 or a[3] > bounds[1] * 0.999):
        found.append("a3, a4: the knee lies outside the measured speeds; only their sum is known")
        return tuple(found)
    found += [f"a{k + 1}: not determined by the data" for k in np.flatnonzero(np.isinf(error))]
    if bounds is not None and UNCERTAIN * a[3] < error[3] < np.inf:
        found.append(
            f"a4: standard error {100 * error[3] / a[3]:.0f} % of its value, and a3 not certain"
        )
    for k in np.flatnonzero(error[:3] > UNCERTAIN * np.abs(a[:3])):
        others = np.abs(correlated[k]) * (np.arange(len(a)) != k)
        partner = int(np.argmax(others))
        # correlation with another parameter from which on only their sum counts as known: each is
        # then three times as uncertain, 1 / sqrt(1 - 0.95^2)
        if others[partner] > 0.95:
            found.append(
                f"a{k + 1}: standard error {100 * error[k] / max(abs(a[k]), 1e-300):.0f} % of "
                f"its value, correlation {correlated[k, partner]:.2f} with a{partner + 1}: only "
                "their combination is known"
            )
    return tuple(found)
