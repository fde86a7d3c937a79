"""The plot of a watch: measured torque of each axis within the threshold, around an alarm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.report.charts.colours import MEASURED, MODEL, MUTED
from hil.report.plots.style import image, legend, panels_in_rows, plotting
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from hil.watching.trace import Trace


def watch(trace: Trace, units: tuple[str, ...] = ()) -> Figure:
    """Draw what is around each axis's first alarm, or the end of the watch."""
    stretches = trace.stretches()
    figure, panels = panels_in_rows(len(stretches), 2.3)
    for axis, (stretch, (panel,)) in enumerate(zip(stretches, panels, strict=True)):
        seen = np.where(np.isfinite(stretch.threshold), stretch.threshold, np.nan)
        low, high = (stretch.predicted + side * seen for side in (-1, 1))
        panel.fill_between(
            stretch.time, low, high, color=MODEL, alpha=0.2, lw=0, label="within the threshold"
        )
        panel.plot(stretch.time, stretch.measured, color=MEASURED, label="measured")
        panel.plot(stretch.time, stretch.predicted, color=MODEL, label="predicted")
        if np.isfinite(stretch.alarm):
            panel.axvline(stretch.alarm, color=MUTED, ls="--", label="alarm")
        panel.set_title(f"axis {axis + 1}")
        panel.set_xlabel("time [s]")
        panel.set_ylabel(f"torque [{units[axis]}]" if units else "torque")
    if panels:
        shown = max(panels, key=lambda each: len(each[0].get_lines()))
        legend(figure, shown[0])
    return figure


def write_watch_plot(folder: Path, trace: Trace, units: tuple[str, ...] = ()) -> Path:
    """Draw a watch into a folder; return the file's path."""
    path = folder / "watch.png"
    with plotting():
        write_file(path, image(watch(trace, units), "png"))
    return path
