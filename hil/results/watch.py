"""Result of watching axes: alarms, thresholds and blindness, saved as a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_file import FileModel, load_yaml
from hil.errors import Mismatch, NotEnoughData
from hil.results.provenance import KeptResult
from hil.show.outcome import Verdict
from hil.show.rounding import clock

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.results.identified_robot import IdentifiedRobot

NAME = "watch.yaml"


class Alarm(FileModel):
    """External torque on an axis, beyond the errors of model and measurement.

    Attributes
    ----------
    axis : int
        Number from 1.
    time : float
        Time of the sample at detection, as in the recordings [s].
    torque, threshold : float
        Mean torque over the window, and the exceeded threshold [N m or N].
    window : float
        Length of the window [s].
    peak : float
        Largest torque until the alarm was over [N m or N].
    lasted : float
        Duration of the alarm [s].
    """

    axis: int
    time: float
    torque: float
    threshold: float
    window: float
    peak: float
    lasted: float = 0.0


class Sight(FileModel):
    """Sensitivity to external torques on an axis.

    Attributes
    ----------
    axis : int
        Number from 1.
    unit : {"N m", "N"}
    limit : float
        Torque limit [N m or N].
    soon, late : float, optional
        Thresholds within `SOON` and within `LATE`, median while the axis moves [N m or N]; None for
        an axis that moved too little.
    still : float
        Share of the time watched in which the axis stood still: slower than 1 % of its velocity
        limit.
    blind, dim : float
        Share of the time watched, around reversals and at rest, in which a push of `STRONG` would
        not be detected within `SOON`, and a push of `WEAK` not within `LATE`.
    distance : float
        Assumed presliding distance [rad or m].
    scatter : tuple of float
        Root mean square of the mean external torque over each window, without contact [N m or N];
        empty in files of earlier versions.
    moved : float
        Time of motion in `scatter` [s].
    reversals : tuple of tuple of float, shape (4, n_distances)
        Sums for the fit of presliding distance and damping (`hil.watching.friction`).
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
    scatter: tuple[float, ...] = ()
    moved: float = 0.0
    reversals: tuple[tuple[float, ...], ...] = ()


LEARNING = 30.0
"""Time of motion for learning thresholds, by default [s]."""
SOON, LATE = 0.02, 0.1
"""Detection times for strong and weak pushes [s]."""
STRONG, WEAK = 0.1, 0.05
"""Sizes of strong and weak pushes, as shares of the torque limit."""


def pushes(alarms: Sequence[Alarm], pause: float = 1.0) -> list[list[Alarm]]:
    """Group the alarms of all axes by pushes.

    A push at a link reaches several axes, and an axis that springs back raises a second alarm. An
    alarm belongs to the previous push if it begins within `pause` of its end [s], a shorter time
    than between two pulls by hand.
    """
    found: list[list[Alarm]] = []
    for alarm in alarms:
        if found and alarm.time - max(each.time + each.lasted for each in found[-1]) < pause:
            found[-1].append(alarm)
        else:
            found.append([alarm])
    return found


class Watched(KeptResult):
    """Results of watching all axes.

    Attributes
    ----------
    robot_digest, plan_digest, model, model_digest : str
        Digests of the watched robot and plan, path of the model's file, and `Model.digest`.
    period : float
        Time between two samples [s].
    learned, watched : float
        Time for learning the scatter, without alarms, and time of watching after that [s].
    """

    names = (NAME,)
    width = 80
    robot_digest: str
    plan_digest: str
    model: str
    model_digest: str = ""
    period: float
    learned: float
    watched: float
    axes: tuple[Sight, ...]
    alarms: tuple[Alarm, ...]

    @property
    def rate(self) -> float:
        """Alarms per hour; NaN if nothing was watched."""
        return 3600 * len(self.alarms) / self.watched if self.watched else float("nan")

    @property
    def verdict(self) -> Verdict:
        """Judgement on reliability, alarms and response times."""
        if not self.watched:
            return Verdict("doubtful", "doubtful", "no motion watched; watch for longer")
        count = f"{len(self.alarms) or 'no'} {'alarm' if len(self.alarms) == 1 else 'alarms'}"
        word = "doubtful" if self.alarms or hardly_watched(self) else "good"
        # a rate per hour says nothing about a shorter time
        often = f", {self.rate:.3g} per hour" if self.watched >= 3600 else ""
        first = ", ".join(f"axis {each.axis} at {each.time:.1f} s" for each in self.alarms[:3])
        more = ", ..." if self.alarms[3:] else ""
        found = f"{count} in {clock(self.watched)}{often}{': ' * bool(first)}{first}{more}"
        return Verdict(word, word, "; ".join((found, *hardly_watched(self))))


def hardly_watched(found: Watched, mostly: float = 0.5) -> tuple[str, ...]:
    """Return a remark on axes without detection of contact for most of the time, with a remedy."""
    blind = [axis for axis in found.axes if found.watched and axis.blind > mostly]
    if not blind:
        return ()
    axes = f"{'axis' if len(blind) == 1 else 'axes'} {', '.join(str(axis.axis) for axis in blind)}"
    return (
        f"{axes}: hardly watched: at rest most of the time, or too little motion to learn from; "
        "use a plan that moves every axis all the time, such as a trajectory",
    )


def load_thresholds(path: Path, model: IdentifiedRobot, period: float | None = None) -> Watched:
    """Read an earlier watch of the same model, for thresholds, from a folder or file.

    Parameters
    ----------
    period : float, optional
        Required time between two samples [s].

    Raises
    ------
    FileError
        The file is missing or damaged.
    Mismatch
        The watch was with another model, or with another period.
    NotEnoughData
        The file is of a version without thresholds for later watches.
    """
    found = load_yaml(path / NAME if path.is_dir() else path, Watched)
    if not all(axis.scatter for axis in found.axes):
        raise NotEnoughData(f"{path}: written by an earlier version, without scatter; watch again")
    if found.model_digest != model.digest:
        raise Mismatch(
            f"{path}: thresholds of model {found.model_digest[:12]} ({found.model}) do not hold for"
            f" model {model.digest[:12]}; watch with this model"
        )
    if period is not None and abs(found.period / period - 1.0) > 1e-9:
        raise Mismatch(
            f"{path}: thresholds hold for samples every {found.period:g} s, not {period:g} s; set "
            "sync_period of the plan, or watch without --thresholds"
        )
    return found
