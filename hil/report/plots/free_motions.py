"""The plot of measured torques beside predicted ones, of one recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.report.charts.chart import Chart, Line, Panel
from hil.report.charts.colours import MEASURED, MODEL, MUTED
from hil.report.plots.predicted_torque import drawn

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.results.recorded_torque import RecordedTorque


def measured_and_predicted(torque: RecordedTorque, robot: Robot) -> Chart:
    """Torques of one recording over time, axis by axis, with their residual."""
    shown, time, hole = drawn(torque.time)
    measured = torque.measured[shown] + hole[:, np.newaxis]
    predicted = torque.predicted[shown] + hole[:, np.newaxis]
    return Chart(
        tuple(
            Panel(
                (
                    Line(time, measured[:, axis], MEASURED, "measured"),
                    Line(time, predicted[:, axis], MODEL, "predicted", dash="5 3"),
                ),
                title=f"axis {axis + 1}",
                x_label="time [s]",
                y_label="torque [N m]" if robot.revolute[axis] else "force [N]",
                below=Panel(
                    (Line(time, (measured - predicted)[:, axis], MUTED, width=0.8),),
                    y_label="residual",
                    height=60.0,
                ),
            )
            for axis in range(robot.n_joints)
        )
    )
