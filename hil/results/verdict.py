"""What a model is worth on another recording, as files keep it: scores by axis, and a verdict.

PASS
    Nothing speaks against the model.
WARN
    It predicts, but something about it does not hold.
REFUSE
    It should not be used.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from checked_files.yaml_file import FileModel

Word = Literal["PASS", "WARN", "REFUSE"]
WORDS: tuple[Word, ...] = ("PASS", "WARN", "REFUSE")
"""Verdicts, from the best."""


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
        Root mean squares; the residual is that of the model's own prediction, its law of friction
        included, as all figures are but the gain and `refitted`.
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
        white noise; friction fitted in the recording where that was done.
    asymmetry : float
        Half the difference of the mean residuals forward and back, over the residual.
    limited : float
        Share of samples at the greatest torque.
    identified : float, optional
        Residual where the model was identified.
    refitted, refitted_inside : float, optional
        `relative` and `inside` of the bodies' torque with friction fitted in the recording; None
        where nothing was fitted.
    own_friction : bool
        Whether the model states friction of this axis; where it does not, all figures have friction
        fitted in the recording.
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
    refitted: float | None = None
    refitted_inside: float | None = None
    own_friction: bool = True

    @property
    def of_bodies(self) -> float:
        """Relative error for which friction is not to blame, as far as it was fitted."""
        return self.relative if self.refitted is None else self.refitted


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


class KeptVerdict(FileModel):
    """What a model was worth on one recording, as its file keeps it.

    Attributes
    ----------
    run : str
        Path of the run's folder, from that of the model's file.
    validated : str
        When.
    verdict, reason : str
    relative : float
        Residual of all axes together over their torque, each as a share of its own.
    """

    run: str
    validated: str
    verdict: Word
    reason: str
    relative: float | None
