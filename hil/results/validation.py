"""How well a model predicts another recording, axis by axis, and what that is worth.

The test that works on a real machine, where no truth is known: a motion that the model was not
made from. Its scores are compared with the naive prediction, the axis's mean torque, which needs no
model at all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.intervals import TWICE
from hil.results.outcome_rules import data_reservations
from hil.results.verdict import AxisScore, Validation
from hil.results.verdict_rules import judged

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from hil.results.model import Model
    from hil.results.predicted_torques import PredictedTorque

    Array = NDArray[np.float64]

FEWEST = 20
"""Samples below which an axis is not scored."""


class _Sums:
    """Sums over one axis's samples; what a recording adds is forgotten at once."""

    def __init__(self) -> None:
        self.n = 0
        self.moments = np.zeros(7)
        self.by_direction = np.zeros((2, 2))
        self.inside = 0
        self.refitted = np.zeros(3)
        self.own_friction = True
        self.greatest: list[Array] = []

    def add(self, each: PredictedTorque) -> None:
        y, f = each.measured, each.predicted
        r = y - f
        left = r if each.refitted is None else y - each.refitted
        self.n += len(y)
        products = (y @ y, r @ r, each.stated @ each.stated, left @ each.stated, left @ left)
        self.moments += [y.sum(), *products, each.parameter_error @ each.parameter_error]
        for k, sign in enumerate((1.0, -1.0)):
            own = np.sign(each.qd) == sign
            self.by_direction[k] += [own.sum(), r[own].sum()]
        self.inside += int(np.sum(np.abs(r) <= TWICE * each.standard_error))
        self.greatest.append(np.abs(y))
        self.own_friction &= each.own_friction
        if each.refitted_error is not None:
            inside = float(np.sum(np.abs(left) <= TWICE * each.refitted_error))
            self.refitted += [float(len(y)), float(left @ left), inside]

    def score(self, axis: int, unit: str, identified: float) -> AxisScore:
        y, yy, rr, ff, lf, ll, ee = self.moments / self.n
        torque, residual = np.sqrt(yy), np.sqrt(rr)
        forward, back = self.by_direction[:, 1] / np.maximum(self.by_direction[:, 0], 1.0)
        size, (n, refitted, inside) = np.concatenate(self.greatest), self.refitted
        return AxisScore(
            axis=axis + 1,
            unit=unit,
            samples=self.n,
            torque=float(torque),
            residual=float(residual),
            relative=float(residual / torque),
            naive=float(np.sqrt(max(yy - y**2, 0.0)) / torque),
            uncertain=float(np.sqrt(ee) / torque),
            inside=self.inside / self.n,
            gain=float(1.0 + lf / ff) if ff > 0 else 1.0,
            gain_error=float(np.sqrt(ll / (self.n * ff))) if ff > 0 else 0.0,
            asymmetry=float(abs(forward - back) / 2 / residual) if residual > 0 else 0.0,
            limited=float(np.mean(size >= size.max() * (1 - 1e-6))),
            identified=None if np.isnan(identified) else float(identified),
            refitted=float(np.sqrt(refitted / n) / torque) if n else None,
            refitted_inside=float(inside / n) if n else None,
            own_friction=self.own_friction,
        )


def validate(model: Model, predicted: Iterable[PredictedTorque]) -> Validation:
    """Score a model's prediction and judge it.

    Parameters
    ----------
    model : Model
    predicted : iterable of PredictedTorque
        By `hil.results.predicted_torques`.
    """
    sums = [_Sums() for _ in range(model.robot.n_joints)]
    for each in predicted:
        sums[each.axis].add(each)
    scores = tuple(
        each.score(axis, model.robot.torque_unit(axis), float(model.residual[axis]))
        for axis, each in enumerate(sums)
        if each.n >= FEWEST
    )
    known = [str(each) for each in data_reservations(model)]
    verdict, reason = judged(scores, model.robot.n_joints, known)
    if model.failed:
        verdict, reason = "REFUSE", f"its identification {model.outcome}"
    return Validation(verdict=verdict, reason=reason, axes=scores)
