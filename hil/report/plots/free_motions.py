"""The plot of measured torques beside predicted ones, of one recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.report.charts.chart import Chart, Line, Panel
from hil.report.charts.colours import MEASURED, MODEL, MUTED

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.results.recorded_torque import RecordedTorque

POINTS = 1500
"""Of a line, at most."""
APART = 0.5
"""Time between samples from which on no line joins them [s]."""


def measured_and_predicted(torque: RecordedTorque, robot: Robot) -> Chart:
    """Torques of one recording over time, axis by axis, with their residual."""
    shown = slice(None, None, max(1, -(-len(torque.time) // POINTS)))
    time = torque.time[shown] - torque.time[0]
    hole = np.where(np.diff(time, prepend=time[:1]) > APART, np.nan, 0.0)
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
