"""`hil watch`: external torques during a plan, written to `watch.yaml`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.commands.torques import model_and_run, played
from hil.results.model import Model
from hil.runs.pooling import recorded
from hil.show.charts.chart import MEASURED, MODEL, Band, Line, Panel, Rule
from hil.show.outcome import Outcome, Played, Plot
from hil.show.rounding import clock, significant
from hil.show.table import Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.results.watch import Alarm, Sight, Watched
    from hil.runs.run import Run
    from hil.show.charts.chart import Item
    from hil.show.table import Row
    from hil.watching.watcher import Trace

PAGE = "watch.html"


def watch(folder: Path, run: Run | None, found: Watched, trace: Trace) -> Outcome:
    """Write the result of a watch into a folder; return the outcome.

    Parameters
    ----------
    run : Run or None
        Run recorded during the watch, if any.
    trace : Trace
        Torques around alarms.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found.write(folder)
    model, units = Model.load(found.model), tuple(axis.unit for axis in found.axes)
    where = (
        "around its first alarm, or at the end without one"
        if found.alarms
        else "at the end of the watch, without an alarm"
    )
    plot = Plot(
        "watch",
        partial(alarm_chart, trace, units),
        f"Measured and predicted torque of every axis {where}.",
        f"Torques of each axis {where}; means over the window of the threshold.",
    )
    return Outcome(
        (watched(found), alarms(found)),
        verdicts=(found.verdict,),
        plots=(plot,),
        title=f"{model.robot.name}: watch",
        facts=model_and_run(Path(found.model), model, folder),
        simulated=run is not None and run.journal.simulated,
        played=Played
        if run is None
        else lambda: played(model, [_alarm_recordings(run, found.alarms)]),
    )


def _alarm_recordings(run: Run, raised: Sequence[Alarm]) -> Run:
    """Return the recordings of each axis's first alarm; the last recording without alarms."""
    first = {each.axis: each.time for each in reversed(raised)}
    kept: list[str] = []
    for motion, recording in recorded(run) if first else ():
        begin, end = recording.time[[0, -1]]
        within = [axis for axis, time in first.items() if begin <= time <= end]
        if within:
            kept.append(motion.id)
        first = {axis: time for axis, time in first.items() if axis not in within}
        if all(time < begin for time in first.values()):
            break
    return run.only(kept or run.ids[-1:])


def watched(found: Watched) -> Table:
    """Return the table of thresholds and detectable torques of the axes."""
    return table(
        "Detectable external torque",
        (
            "axis",
            *figures("within 20 ms", "% of limit", "within 0.1 s", "% of limit"),
            *figures("still, %", "blind, %", "dim, %"),
        ),
        map(_row, found.axes),
        "Smallest external torques detected 20 ms and 0.1 s after their start, medians over the "
        "time in motion; a dash: too little motion. Still: share of time at rest, where only "
        "torques above friction are detected. Blind: share of time, around reversals and at "
        "rest, in which a tenth of the torque limit is not detected within 20 ms; dim: the "
        "same for a twentieth of the limit within 0.1 s.",
        (f"thresholds learned from {clock(found.learned)} of motion",) if found.learned else (),
    )


def alarms(found: Watched, most: int = 20) -> Table:
    """Return the table of the first alarms; the file holds more."""
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
        "Start of the alarm, external torque seen (mean over the window) and its threshold; "
        "peak: largest external torque during the alarm.",
        (f"{left} more alarms in the file",) if left > 0 else (),
    )


def _row(axis: Sight) -> Row:
    cells: list[str] = []
    for each in (axis.soon, axis.late):
        known = f"{significant(each, 3)} {axis.unit}" if each is not None else "–"
        cells += known, "–" if each is None else significant(100 * each / axis.limit, 2)
    return (str(axis.axis), *cells, *(f"{100 * x:.1f}" for x in (axis.still, axis.blind, axis.dim)))


def alarm_chart(trace: Trace, units: tuple[str, ...]) -> Iterator[Panel]:
    """Draw torques around each axis's first alarm, or at the end of the watch."""
    for axis, (stretch, unit) in enumerate(zip(trace.stretches(), units, strict=True), start=1):
        seen = np.where(np.isfinite(stretch.threshold), stretch.threshold, np.nan)
        low, high = (stretch.predicted + side * seen for side in (-1, 1))
        items: list[Item] = [
            Band(stretch.time, low, high, label="within the threshold"),
            Line(stretch.time, stretch.measured, MEASURED, "measured"),
            Line(stretch.time, stretch.predicted, MODEL, "predicted", "5 3"),
        ]
        if np.isfinite(stretch.alarm):
            items.append(Rule(stretch.alarm, upright=True, label="alarm", dash="4 3"))
        yield Panel(
            tuple(items),
            title=f"axis {axis}",
            x_label="time [s]",
            y_label=f"torque [{unit}]",
            width=357.0,
        )
