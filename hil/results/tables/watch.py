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


def watched(found: Watched) -> Table:
    """How well each axis was seen."""
    return Table(
        title="Torque from outside that is seen",
        columns=(
            Column("axis"),
            *figures("within 20 ms", "% of limit", "within 0.1 s", "% of limit"),
            *figures("blind, %", "dim, %"),
        ),
        parts=(Part(tuple(_row(axis) for axis in found.axes)),),
        explanation=(
            "Thresholds of means over windows that end 20 ms and 0.1 s after a push began, medians"
            " over the time in motion. Blind is the share of all the time, around reversals and at"
            " rest, in which a tenth of the torque limit would not be seen within 20 ms, dim that"
            " in which a twentieth would not be seen within 0.1 s."
        ),
        notes=(_sentence(found),),
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


def _row(axis: Sight) -> Row:
    cells = []
    for threshold in (axis.soon, axis.late):
        cells += [
            f"{significant(threshold, 3)} {axis.unit}",
            significant(100 * threshold / axis.limit, 2),
        ]
    return (str(axis.axis), *cells, f"{100 * axis.blind:.1f}", f"{100 * axis.dim:.1f}")


def _alarm(alarm: Alarm, unit: str) -> Row:
    torques = (significant(x, 3) for x in (alarm.torque, alarm.threshold, alarm.peak))
    return (
        str(alarm.axis), f"{alarm.time:.3f}", *torques, unit, f"{1e3 * alarm.window:.0f}",
        f"{alarm.lasted:.2f}",
    )  # fmt: skip
