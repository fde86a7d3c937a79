"""What was found while axes were watched: alarms, thresholds, blindness; kept as a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import yaml

from checked_files.yaml_file import FileModel
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from pathlib import Path

NAME = "watch.yaml"


class Alarm(FileModel):
    """Torque from outside on one axis, beyond what model and measurement can differ by.

    Attributes
    ----------
    axis : int
        From 1.
    time : float
        Of the sample that showed it, as in the recordings [s].
    torque, threshold : float
        Mean over the window, and what it exceeded [N m or N].
    window : float
        [s].
    peak : float
        Largest torque until the alarm was over [N m or N].
    lasted : float
        [s].
    """

    axis: int
    time: float
    torque: float
    threshold: float
    window: float
    peak: float
    lasted: float = 0.0


class Sight(FileModel):
    """How well one axis is seen.

    Attributes
    ----------
    axis : int
        From 1.
    unit : {"N m", "N"}
    limit : float
        Torque limit [N m or N].
    soon, late : float, optional
        Thresholds within `SOON` and within `LATE`, median while the axis moves [N m or N]; None of
        an axis that has moved too little.
    still : float
        Share of the time watched in which the axis stood still: slower than 1 % of its velocity
        limit.
    blind, dim : float
        Share of the time watched, around reversals and at rest, in which `STRONG` of the limit
        would not be seen within `SOON`, and `WEAK` of it not within `LATE`.
    distance : float
        Presliding distance that was taken [rad or m].
    """

    axis: int
    unit: str
    limit: float
    soon: float | None
    late: float | None
    still: float
    blind: float
    dim: float
    distance: float


SOON, LATE = 0.02, 0.1
"""Times within which a strong and a weak push are to be seen [s]."""
STRONG, WEAK = 0.1, 0.05
"""Sizes of such pushes, as shares of the torque limit."""


class Watched(FileModel):
    """What was found of all axes.

    Attributes
    ----------
    robot_digest, plan_digest, model : str
        Of what was watched, and the path of the model's file.
    period : float
        Time between two samples [s].
    learned, watched : float
        Time in which scatter was learned and no alarm raised, and time after that [s].
    axes : tuple of Sight
    alarms : tuple of Alarm
    """

    robot_digest: str
    plan_digest: str
    model: str
    period: float
    learned: float
    watched: float
    axes: tuple[Sight, ...]
    alarms: tuple[Alarm, ...]

    @property
    def rate(self) -> float:
        """Alarms an hour; NaN where nothing was watched."""
        return 3600 * len(self.alarms) / self.watched if self.watched else float("nan")


def write_watched(folder: Path, found: Watched) -> Path:
    """Keep what was found in a folder; return the file's path."""
    path = folder / NAME
    write_file(path, yaml.safe_dump(found.model_dump(mode="json"), sort_keys=False).encode())
    return path
