"""What was found while axes were watched: how well each was seen, and alarms."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.rounding import clock, significant
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from hil.results.tables.table import Row
    from hil.results.watch import Alarm, Sight, Watched

MOST = 20
"""Alarms that are listed; all are in the file."""
MOSTLY = 0.5
"""Share of the time from which an axis that was blind is named."""


def watched(found: Watched) -> Table:
    """How well each axis was seen."""
    return Table(
        title="Torque from outside that is seen",
        columns=(
            Column("axis"),
            *figures("within 20 ms", "% of limit", "within 0.1 s", "% of limit"),
            *figures("still, %", "blind, %", "dim, %"),
        ),
        parts=(Part(tuple(_row(axis) for axis in found.axes)),),
        explanation=(
            "Thresholds of means over windows that end 20 ms and 0.1 s after a push began, medians"
            " over the time in motion; a dash where an axis has moved too little. Still is the"
            " share of all the time in which the axis stood, and showed only what exceeds its"
            " friction. Blind is the share, around reversals and at rest, in which a tenth of the"
            " torque limit would not be seen within 20 ms, dim that in which a twentieth would not"
            " be seen within 0.1 s."
        ),
        notes=(_sentence(found), *_hardly_watched(found)),
    )


def alarms(found: Watched) -> Table:
    """The first alarms; no rows without any."""
    units = {axis.axis: axis.unit for axis in found.axes}
    rows = tuple(_alarm(alarm, units[alarm.axis]) for alarm in found.alarms[:MOST])
    left = len(found.alarms) - MOST
    return Table(
        title="Alarms",
        columns=(Column("axis"), *figures("at, s", "seen", "threshold", "peak"), Column("unit"),
                 *figures("window, ms", "lasted, s")),
        parts=(Part(rows),) if rows else (),
        explanation=(
            "When an alarm began, the mean torque from outside that showed it and the threshold of"
            " its window; largest torque until it was over."
        ),
        notes=(f"{left} more alarms in the file",) if left > 0 else (),
    )  # fmt: skip


def _sentence(found: Watched) -> str:
    learned = f"thresholds learned from {clock(found.learned)} of motion"
    if not found.watched:
        return f"{learned}; nothing was watched, watch for longer"
    number = len(found.alarms) or "no"
    alarm = "alarm" if len(found.alarms) == 1 else "alarms"
    return f"{number} {alarm} in {clock(found.watched)}, {found.rate:.3g} an hour; {learned}"


def _hardly_watched(found: Watched) -> tuple[str, ...]:
    """Which axes were blind for most of the time, and what would watch them."""
    blind = [axis for axis in found.axes if found.watched and axis.blind > MOSTLY]
    if not blind:
        return ()
    axes = f"{'axis' if len(blind) == 1 else 'axes'} {', '.join(str(axis.axis) for axis in blind)}"
    return (
        f"{axes}: hardly watched, because still for most of the time or too little seen before;"
        " a plan that moves every axis all the time watches them, such as a trajectory",
    )


def _row(axis: Sight) -> Row:
    cells: list[str] = []
    for threshold in (axis.soon, axis.late):
        if threshold is None:
            cells += ["–", "–"]
            continue
        cells += [
            f"{significant(threshold, 3)} {axis.unit}",
            significant(100 * threshold / axis.limit, 2),
        ]
    return (str(axis.axis), *cells, *(f"{100 * x:.1f}" for x in (axis.still, axis.blind, axis.dim)))


def _alarm(alarm: Alarm, unit: str) -> Row:
    torques = (significant(x, 3) for x in (alarm.torque, alarm.threshold, alarm.peak))
    return (
        str(alarm.axis), f"{alarm.time:.3f}", *torques, unit, f"{1e3 * alarm.window:.0f}",
        f"{alarm.lasted:.2f}",
    )  # fmt: skip
