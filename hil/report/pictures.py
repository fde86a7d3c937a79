"""Charts of commands beside the report: how axes follow, and what a watch has seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.report.charts.chart import MEASURED, MODEL, MUTED, Band, Chart, Line, Panel, Rule, chart
from hil.results.tracking import PASSES, following_error, trajectories

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from hil.report.charts.chart import Item
    from hil.runs.run import Run
    from hil.simulation.replay import Replay
    from hil.watching.trace import Trace, TraceStretch

PASS_LINES = {
    "neither": ("neither", MUTED),
    "velocity": ("velocity", MODEL),
    "both": ("velocity and torque", MEASURED),
}
"""Label and colour of each pass of a tracking."""


def tracking(runs: Mapping[str, Run], delay: float) -> Chart:
    """Following errors over the first period of the first trajectory; below, the smaller ones.

    Parameters
    ----------
    runs : mapping
        By name of the pass.
    delay : float
        See `hil.results.tracking`.
    """
    robot = runs[PASSES[0]].robot
    lines: list[dict[str, Line]] = [{} for _ in range(robot.n_joints)]
    for name in PASSES:
        trajectory, recording = trajectories(runs[name])[0]
        time, error, _ = following_error(recording, trajectory, delay)
        shown = np.flatnonzero(time <= trajectory.period)
        shown = shown[:: max(1, len(shown) // 700)]
        label, colour = PASS_LINES[name]
        for axis, own in enumerate(lines):
            own[name] = Line(time[shown], 1e3 * error[shown, axis], colour, label)
    return chart(
        Panel(
            tuple(own.values()),
            title=f"axis {axis}",
            x_label="time [s]",
            y_label=f"error [m{robot.position_unit(axis - 1)}]",
            below=Panel([own[name] for name in PASSES if name != "neither"], height=90.0),
            width=357.0,
            height=110.0,
        )
        for axis, own in enumerate(lines, start=1)
    )


def watch(trace: Trace, units: tuple[str, ...]) -> Chart:
    """Torques around each axis's first alarm, or at the end of the watch."""
    return chart(
        Panel(
            tuple(_watched(stretch)),
            title=f"axis {axis}",
            x_label="time [s]",
            y_label=f"torque [{unit}]",
            width=357.0,
        )
        for axis, (stretch, unit) in enumerate(zip(trace.stretches(), units, strict=True), start=1)
    )


def _watched(stretch: TraceStretch) -> Iterator[Item]:
    seen = np.where(np.isfinite(stretch.threshold), stretch.threshold, np.nan)
    low, high = (stretch.predicted + side * seen for side in (-1, 1))
    yield Band(stretch.time, low, high, label="within the threshold")
    yield Line(stretch.time, stretch.measured, MEASURED, "measured")
    yield Line(stretch.time, stretch.predicted, MODEL, "predicted", "5 3")
    if np.isfinite(stretch.alarm):
        yield Rule(stretch.alarm, upright=True, label="alarm", dash="4 3")


def replay(found: Replay) -> Chart:
    """Recorded and simulated positions of each axis, of the recording with its largest error."""
    return chart(_replayed(found, axis) for axis in range(found.robot.n_joints))


def _replayed(found: Replay, axis: int) -> Panel:
    shown = max(found.recordings, key=lambda each: np.nanmax(np.abs(each.error[:, axis])))
    every = slice(None, None, max(1, len(shown.time) // 700))
    time = shown.time[every]
    recorded, simulated, error = (
        x[every, axis] for x in (shown.recorded, shown.simulated, shown.error)
    )
    unit = found.robot.position_unit(axis)
    return Panel(
        (
            Line(time, recorded, MEASURED, "recorded"),
            Line(time, simulated, MODEL, "simulated", "5 3"),
        ),
        title=f"axis {axis + 1}, {shown.measurement}",
        x_label="time [s]",
        y_label=f"position [{unit}]",
        below=Panel(
            (Rule(0.0), Line(time, 1e3 * error, MODEL, width=0.9)),
            y_label=f"Δ [m{unit}]",
            height=42.0,
        ),
        width=357.0,
        height=112.0,
        recording=shown.measurement,
    )
