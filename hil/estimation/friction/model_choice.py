"""Which friction model an axis deserves, by the error at speeds that the fit has not seen.

All models are odd functions, so least squares over both directions is least squares over their
mean, and that is what they are fitted to: friction's asymmetry is tested by itself.

Each speed is held out in turn, all repetitions of it together, the model is fitted to the rest and
its error at the speed held out is noted (leave-one-out cross-validation).

The simplest model is kept unless another one is better by more than chance: the model with the
least mean error is compared with the simpler ones, from the simplest on, and the first that it does
not beat at significantly more speeds, or by more (Wilcoxon's signed-rank test of the errors, speed
by speed), is chosen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.friction.models import LAWS, fit_model, n_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.friction.models import FrictionModel, Law
    from hil.estimation.friction.points import FrictionPoint

    Array = NDArray[np.float64]

SIGNIFICANT = 0.05
"""p-value below which a richer model counts as better."""
ALIKE = 0.02
"""Speeds that differ by less than this share are one speed."""


@dataclass(frozen=True, slots=True, eq=False)
class AxisFriction:
    """The friction of one axis.

    Attributes
    ----------
    axis : int
        From 0.
    velocity, torque : ndarray, shape (n,)
        What the models were fitted to: speeds [rad/s], mean friction of both directions [N m].
    models : dict
        All models that there were enough speeds for, by kind.
    held_out : dict
        Mean quadratic error at speeds held out, by kind [N^2 m^2].
    chosen : str
        Law of the model that is recommended.
    """

    axis: int
    velocity: Array
    torque: Array
    models: dict[Law, FrictionModel]
    held_out: dict[Law, float]
    chosen: Law

    @property
    def model(self) -> FrictionModel:
        """The recommended model."""
        return self.models[self.chosen]


def choose(axis: int, points: Sequence[FrictionPoint], limit: float) -> AxisFriction | None:
    """Fit all models to the points of one axis and recommend one.

    Parameters
    ----------
    axis : int
        From 0.
    points : sequence of FrictionPoint
        Those of the axis.
    limit : float
        Its speed limit [rad/s].

    Returns
    -------
    AxisFriction or None
        None with less than three speeds: no model can be checked then.
    """
    velocity, torque, speed = _data(points)
    n = len(np.unique(speed))
    kinds = [kind for kind in LAWS if n > n_parameters(kind)]
    if not kinds:
        return None
    errors = {kind: _held_out(kind, velocity, torque, speed, limit) for kind in kinds}
    return AxisFriction(
        axis=axis,
        velocity=velocity,
        torque=torque,
        models={kind: fit_model(kind, velocity, torque, limit) for kind in kinds},
        held_out={kind: float(np.mean(error)) for kind, error in errors.items()},
        chosen=_simplest(errors),
    )


def _data(points: Sequence[FrictionPoint]) -> tuple[Array, Array, NDArray[np.intp]]:
    """Speeds, friction torques, and the number of the speed that each belongs to."""
    v = np.array([point.velocity for point in points])
    order = np.argsort(v)
    steps = np.diff(np.log(v[order]), prepend=np.log(v.min())) > ALIKE
    speed = np.empty(len(v), dtype=np.intp)
    speed[order] = np.cumsum(steps)
    return v, np.array([point.friction for point in points]), speed


def _held_out(
    kind: Law, velocity: Array, torque: Array, speed: NDArray[np.intp], limit: float
) -> Array:
    """Mean quadratic error at each speed, the model fitted to all others, shape (n_speeds,)."""
    errors = []
    for number in np.unique(speed):
        out = speed == number
        model = fit_model(kind, velocity[~out], torque[~out], limit)
        errors.append(float(np.mean((torque[out] - model.torque(velocity[out])) ** 2)))
    return np.array(errors)


def _simplest(errors: dict[Law, Array]) -> Law:
    from scipy import stats  # noqa: PLC0415 - loads for a second, and only this test is needed

    best = min(errors, key=lambda kind: float(errors[kind].mean()))
    simpler = [kind for kind in errors if n_parameters(kind) < n_parameters(best)]
    for kind in simpler:
        worse = errors[kind] - errors[best]
        if stats.wilcoxon(worse, alternative="greater").pvalue > SIGNIFICANT:
            return kind
    return best
