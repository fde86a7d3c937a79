"""Friction of each axis over a campaign: the law, its curve, and how far the level wandered."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.friction_law import friction_torque, friction_variance
from hil.results.rounding import significant, uncertain
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from hil.estimation.friction_law import AxisLaw
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.tables.table import Row


def campaign_friction(model: IdentifiedRobot) -> Table:
    """Law of each axis and its friction at two speeds; empty where none was found."""
    law = model.friction_law
    if law is None or model.friction is not None:
        return Table("", (), ())
    rows = [_row(model, axis, own) for axis, own in enumerate(law.axes) if own is not None]
    return Table(
        title="Friction over the campaign",
        columns=(
            Column("axis"),
            Column("law", folds=True),
            *figures("speeds", "at slowest", "at fastest", "wander, %"),
        ),
        parts=(Part(tuple(rows)),),
        explanation=(
            f"Friction forward at no load [{model.robot.torque_units}] with the standard error that"
            " counts in predicted torques, at the slowest and the fastest of the speeds"
            f" [{model.robot.position_units} per s]; how far its level was from the law in any one"
            " measurement."
        ),
    )


def _row(model: IdentifiedRobot, axis: int, own: AxisLaw) -> Row:
    assert model.friction_law is not None  # noqa: S101 - there is no row without
    slowest, fastest = own.speeds or (0.0, own.speed)
    qd = np.zeros((2, model.robot.n_joints))
    qd[:, axis] = slowest, fastest
    still = np.zeros_like(qd)
    tau, variance = (
        each(model.robot, model.friction_law, still, qd, still)[:, axis]
        for each in (friction_torque, friction_variance)
    )
    shown = (
        " ± ".join(uncertain(float(value), float(np.sqrt(error))))
        for value, error in zip(tau, variance, strict=True)
    )
    speeds = f"{significant(slowest, 2)} to {significant(fastest, 3)}"
    return str(axis + 1), own.law, speeds, *shown, significant(100 * own.wander, 2)
