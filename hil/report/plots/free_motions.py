"""The plot of measured torques beside predicted ones; draw it within `style.plotting`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.plots.predicted_torque import draw_prediction
from hil.report.plots.style import legend, panels_in_rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hil.model.robot import Robot
    from hil.results.recorded_torque import RecordedTorque


def measured_and_predicted(torque: RecordedTorque, robot: Robot) -> Figure:
    """Torques of one recording over time, axis by axis, with their residual."""
    figure, panels = panels_in_rows(robot.n_joints, height=2.6, strip=0.4)
    for axis, (panel, strip) in enumerate(panels):
        measured, predicted = torque.measured[:, axis], torque.predicted[:, axis]
        draw_prediction(panel, strip, torque.time, measured, predicted)
        panel.set_title(f"axis {axis + 1}")
        panel.set_ylabel("torque [N m]" if robot.revolute[axis] else "force [N]")
    legend(figure, panels[0][0])
    return figure
