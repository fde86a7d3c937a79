"""The plot of a tracking: following errors of each axis over a period, by what is fed forward."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.charts.colours import MEASURED, MODEL, MUTED
from hil.report.plots.style import image, legend, panels_in_rows, plotting
from hil.results.tracking import PASSES, following_error, trajectories
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from hil.runs.run import Run

LABELS = {"neither": "neither", "velocity": "velocity", "both": "velocity and torque"}
COLORS = {"neither": MUTED, "velocity": MODEL, "both": MEASURED}


def tracking(runs: dict[str, Run], delay: float) -> Figure:
    """Draw the first period of the first trajectory; below it the smaller errors by themselves.

    Parameters
    ----------
    runs : dict
        By name of the pass.
    delay : float
        See `hil.results.tracking`.
    """
    robot = runs[PASSES[0]].robot
    figure, panels = panels_in_rows(robot.n_joints, 2.6, strip=0.8)
    for name in PASSES:
        trajectory, recording = trajectories(runs[name])[0]
        time, error, _ = following_error(recording, trajectory, delay)
        shown = time <= trajectory.period
        for axis, (above, below) in enumerate(panels):
            for panel in (above,) if name == "neither" else (above, below):
                panel.plot(
                    time[shown], 1e3 * error[shown, axis], color=COLORS[name], label=LABELS[name]
                )
    for axis, (above, below) in enumerate(panels):
        above.set_title(f"axis {axis + 1}")
        above.set_ylabel(f"[m{robot.position_unit(axis)}]")
        above.tick_params(labelbottom=False)
        below.set_xlabel("time [s]")
    legend(figure, panels[0][0])
    return figure


def write_tracking_plot(folder: Path, runs: dict[str, Run], delay: float) -> Path:
    """Draw a tracking into a folder; return the file's path."""
    path = folder / "tracking.png"
    with plotting():
        write_file(path, image(tracking(runs, delay), "png"))
    return path
