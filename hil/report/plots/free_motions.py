"""The plot of measured torques beside predicted ones; draw it within `style.plotting`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.report.plots.style import MEASURED, MODEL, MUTED, legend, panels_in_rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hil.model.robot import Robot
    from hil.results.recorded_torque import RecordedTorque

POINTS = 1500
"""Of a line, at most."""


def measured_and_predicted(torque: RecordedTorque, robot: Robot) -> Figure:
    """Torques of one recording over time, axis by axis, with their residual."""
    figure, panels = panels_in_rows(robot.n_joints, height=2.6, strip=0.4)
    shown = slice(None, None, max(1, -(-len(torque.time) // POINTS)))
    t = torque.time[shown] - torque.time[0]
    for axis, (panel, strip) in enumerate(panels):
        panel.plot(t, torque.measured[shown, axis], color=MEASURED, label="measured")
        panel.plot(t, torque.predicted[shown, axis], color=MODEL, label="model", linewidth=0.8)
        panel.set_title(f"axis {axis + 1}")
        panel.set_ylabel("torque [N m]" if robot.revolute[axis] else "force [N]")
        panel.tick_params(labelbottom=False)
        strip.plot(t, torque.residual[shown, axis], color=MUTED, linewidth=0.7)
        strip.set_ylim(*_ends(torque.residual[:, axis]))
        strip.set_ylabel("residual")
        strip.set_xlabel("time [s]")
    legend(figure, panels[0][0])
    return figure


def _ends(residual: np.ndarray) -> tuple[float, float]:
    size = 1.1 * float(np.abs(residual).max(initial=1e-9))
    return -size, size
