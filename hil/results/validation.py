"""How well a model predicts another recording, axis by axis, and what that is worth.

The test that works on a real machine, where no truth is known: a motion that the model was not
made from. Its scores are compared with the naive prediction, the axis's mean torque, which needs no
model at all. The verdict states one reason, the worst.

PASS
    Nothing speaks against the model.
WARN
    It predicts, but something about it does not hold.
REFUSE
    It should not be used, for the reason stated.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from checked_files.yaml_file import FileModel
from hil.results.outcome import data_reservations
from hil.results.verdict import Word, judged

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from hil.results.model import Model
    from hil.results.predicted_torques import PredictedTorque

    Array = NDArray[np.float64]

TWICE = 1.96
"""Standard errors of an interval of 95 %."""
FEWEST = 20
"""Samples below which an axis is not scored."""


class AxisScore(FileModel):
    """How well one axis was predicted.

    Attributes
    ----------
    axis : int
        Number from 1.
    unit : str
        Of torques: N m or N.
    samples : int
    torque, residual : float
        Root mean squares.
    relative : float
        Residual over torque.
    naive : float
        The same where the mean torque is the prediction.
    uncertain : float
        What the base parameters' standard errors amount to, over the torque.
    inside : float
        Share of samples inside the predicted intervals of 95 %.
    gain, gain_error : float
        Factor of what the model states that fits best, and its standard error were the residuals
        white noise.
    asymmetry : float
        Half the difference of the mean residuals forward and back, over the residual.
    limited : float
        Share of samples at the greatest torque.
    identified : float, optional
        Residual where the model was identified.
    drive_relative, drive_inside : float, optional
        `relative` and `inside` of the torque with the friction that the model states, where the
        others have friction fitted in the recording.
    """

    axis: int = Field(ge=1)
    unit: str
    samples: int
    torque: float
    residual: float
    relative: float
    naive: float
    uncertain: float = 0.0
    inside: float
    gain: float
    gain_error: float
    asymmetry: float
    limited: float
    identified: float | None
    drive_relative: float | None = None
    drive_inside: float | None = None


class _Sums:
    """Sums over one axis's samples; what a recording adds is forgotten at once."""

    def __init__(self) -> None:
        self.n = 0
        self.moments = np.zeros(6)
        self.by_direction = np.zeros((2, 2))
        self.inside = 0
        self.driven = np.zeros(3)
        self.greatest: list[Array] = []

    def add(self, each: PredictedTorque) -> None:
        y, f = each.measured, each.predicted
        r = y - f
        self.n += len(y)
        products = (y @ y, r @ r, each.stated @ each.stated, r @ each.stated)
        self.moments += [y.sum(), *products, each.parameter_error @ each.parameter_error]
        for k, sign in enumerate((1.0, -1.0)):
            own = np.sign(each.qd) == sign
            self.by_direction[k] += [own.sum(), r[own].sum()]
        self.inside += int(np.sum(np.abs(r) <= TWICE * each.standard_error))
        self.greatest.append(np.abs(y))
        if each.drive is not None and each.drive_error is not None:
            d = y - each.drive
            inside = float(np.sum(np.abs(d) <= TWICE * each.drive_error))
            self.driven += [float(len(y)), float(d @ d), inside]

    def score(self, axis: int, unit: str, identified: float) -> AxisScore:
        y, yy, rr, ff, rf, ee = self.moments / self.n
        torque, residual = np.sqrt(yy), np.sqrt(rr)
        forward, back = self.by_direction[:, 1] / np.maximum(self.by_direction[:, 0], 1.0)
        size, (n, driven, inside) = np.concatenate(self.greatest), self.driven
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
            gain=float(1.0 + rf / ff) if ff > 0 else 1.0,
            gain_error=float(residual / np.sqrt(self.n * ff)) if ff > 0 else 0.0,
            asymmetry=float(abs(forward - back) / 2 / residual) if residual > 0 else 0.0,
            limited=float(np.mean(size >= size.max() * (1 - 1e-6))),
            identified=None if np.isnan(identified) else float(identified),
            drive_relative=float(np.sqrt(driven / n) / torque) if n else None,
            drive_inside=float(inside / n) if n else None,
        )


class Validation(FileModel):
    """A model judged by another recording.

    Attributes
    ----------
    verdict : {"PASS", "WARN", "REFUSE"}
    reason : str
        One sentence: the worst of what was found.
    axes : tuple of AxisScore
    """

    verdict: Word
    reason: str
    axes: tuple[AxisScore, ...]

    @property
    def relative(self) -> float:
        """Residual of all axes together over their torque, each as a share of its own."""
        return float(np.sqrt(np.mean([each.relative**2 for each in self.axes])))


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
        each.score(axis, "N m" if model.robot.revolute[axis] else "N", float(model.residual[axis]))
        for axis, each in enumerate(sums)
        if each.n >= FEWEST
    )
    known = [str(each) for each in data_reservations(model)]
    verdict, reason = judged(scores, model.robot.n_joints, known)
    return Validation(verdict=verdict, reason=reason, axes=scores)
