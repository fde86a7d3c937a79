"""What was found while axes were watched: alarms, thresholds, blindness; kept as a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_file import FileModel
from hil.results.rounding import clock, significant
from hil.results.tables.table import Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.results.tables.table import Row


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
    def outcome(self) -> tuple[str, str, str]:
        """How far it can be relied on, what was found, and in what time."""
        if not self.watched:
            return "doubtful", "nothing was watched", "watch for longer"
        count = f"{len(self.alarms) or 'no'} {'alarm' if len(self.alarms) == 1 else 'alarms'}"
        word = "doubtful" if self.alarms or _hardly_watched(self) else "good"
        return word, count, f"in {clock(self.watched)}, {self.rate:.3g} an hour"


def watched(found: Watched) -> Table:
    """How well each axis was seen."""
    return table(
        "Torque from outside that is seen",
        (
            "axis",
            *figures("within 20 ms", "% of limit", "within 0.1 s", "% of limit"),
            *figures("still, %", "blind, %", "dim, %"),
        ),
        map(_row, found.axes),
        "Thresholds of means over windows that end 20 ms and 0.1 s after a push began, medians"
        " over the time in motion; a dash where an axis has moved too little. Still is the"
        " share of all the time in which the axis stood, and showed only what exceeds its"
        " friction. Blind is the share, around reversals and at rest, in which a tenth of the"
        " torque limit would not be seen within 20 ms, dim that in which a twentieth would not"
        " be seen within 0.1 s.",
        (_sentence(found), *_hardly_watched(found)),
    )


def alarms(found: Watched, most: int = 20) -> Table:
    """The first alarms; no rows without any, and all of them are in the file."""
    units = {axis.axis: axis.unit for axis in found.axes}
    left = len(found.alarms) - most
    return table(
        "Alarms",
        (
            "axis",
            *figures("at, s", "seen", "threshold", "peak"),
            "unit",
            *figures("window, ms", "lasted, s"),
        ),
        (
            (
                str(each.axis),
                f"{each.time:.3f}",
                *(significant(x, 3) for x in (each.torque, each.threshold, each.peak)),
                units[each.axis],
                f"{1e3 * each.window:.0f}",
                f"{each.lasted:.2f}",
            )
            for each in found.alarms[:most]
        ),
        "When an alarm began, the mean torque from outside that showed it and the threshold of"
        " its window; largest torque until it was over.",
        (f"{left} more alarms in the file",) if left > 0 else (),
    )


def _sentence(found: Watched) -> str:
    learned = f"thresholds learned from {clock(found.learned)} of motion"
    _, what, how = found.outcome
    return f"{what} {how}; {learned}" if found.watched else f"{learned}; {what}, {how}"


def _hardly_watched(found: Watched, mostly: float = 0.5) -> tuple[str, ...]:
    """Which axes were blind for most of the time, and what would watch them."""
    blind = [axis for axis in found.axes if found.watched and axis.blind > mostly]
    if not blind:
        return ()
    axes = f"{'axis' if len(blind) == 1 else 'axes'} {', '.join(str(axis.axis) for axis in blind)}"
    return (
        f"{axes}: hardly watched, because still for most of the time or too little seen before;"
        " a plan that moves every axis all the time watches them, such as a trajectory",
    )


def _row(axis: Sight) -> Row:
    cells: list[str] = []
    for each in (axis.soon, axis.late):
        known = f"{significant(each, 3)} {axis.unit}" if each is not None else "–"
        cells += known, "–" if each is None else significant(100 * each / axis.limit, 2)
    return (str(axis.axis), *cells, *(f"{100 * x:.1f}" for x in (axis.still, axis.blind, axis.dim)))
