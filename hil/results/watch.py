"""What was found while axes were watched: alarms, thresholds, blindness; kept as a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_file import FileModel
from hil.show.outcome import Verdict
from hil.show.rounding import clock

if TYPE_CHECKING:
    from collections.abc import Sequence

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


def pushes(alarms: Sequence[Alarm], pause: float = 1.0) -> list[list[Alarm]]:
    """Group the alarms of all axes by the push that raised them.

    A push at one link reaches several axes, and an axis that springs back raises a second alarm: an
    alarm belongs to the push before if it begins within `pause` of its end [s], sooner than a hand
    lets go and pulls again.
    """
    found: list[list[Alarm]] = []
    for alarm in alarms:
        if found and alarm.time - max(each.time + each.lasted for each in found[-1]) < pause:
            found[-1].append(alarm)
        else:
            found.append([alarm])
    return found


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

    @property
    def verdict(self) -> Verdict:
        """How far it can be relied on, what was found, and in what time."""
        if not self.watched:
            return Verdict("doubtful", "doubtful", "nothing was watched, watch for longer")
        count = f"{len(self.alarms) or 'no'} {'alarm' if len(self.alarms) == 1 else 'alarms'}"
        word = "doubtful" if self.alarms or hardly_watched(self) else "good"
        return Verdict(word, word, f"{count} in {clock(self.watched)}, {self.rate:.3g} an hour")


def hardly_watched(found: Watched, mostly: float = 0.5) -> tuple[str, ...]:
    """Which axes were blind for most of the time, and what would watch them."""
    blind = [axis for axis in found.axes if found.watched and axis.blind > mostly]
    if not blind:
        return ()
    axes = f"{'axis' if len(blind) == 1 else 'axes'} {', '.join(str(axis.axis) for axis in blind)}"
    return (
        f"{axes}: hardly watched, because still for most of the time or too little seen before;"
        " a plan that moves every axis all the time watches them, such as a trajectory",
    )
