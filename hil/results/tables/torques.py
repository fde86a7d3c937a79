"""Torques axis by axis: what is left of those measured, and how certain predicted ones are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.results.rounding import percent, significant
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.prediction import Prediction
    from hil.results.tables.table import Row


def residuals(model: IdentifiedRobot) -> Table:
    """What the method's models leave of each axis's torque."""
    axes, unit = range(model.robot.n_joints), model.robot.torque_units
    return Table(
        title="Torque left by the fit",
        columns=(Column("axis"), *figures(f"limit, {unit}", f"rms, {unit}", "% of limit")),
        parts=(Part(tuple(_residual(model, axis) for axis in axes)),),
        explanation=(
            "Root mean square of what the local models of inertia and coupling leave of the torque."
        ),
    )


def _residual(model: IdentifiedRobot, axis: int) -> Row:
    left, limit = float(model.residual[axis]), float(model.robot.torque_limit[axis])
    if np.isnan(left):
        return str(axis + 1), f"{limit:g}", "not measured", ""
    return str(axis + 1), f"{limit:g}", significant(left, 3), percent(left, limit)


def predicted(prediction: Prediction, robot: Robot) -> Table:
    """Torques of a free motion and their standard error, joint by joint."""
    each = zip(prediction.torque, prediction.standard_error, strict=True)
    unit = robot.torque_units
    return Table(
        title="Predicted torques",
        columns=(Column("axis"), *figures(f"rms, {unit}", f"std. error, {unit}", "%")),
        parts=(Part(tuple(_predicted(k, float(t), float(e)) for k, (t, e) in enumerate(each))),),
        explanation=(
            "Rigid-body torques on a free motion that uses the limits, and their standard error."
        ),
    )


def _predicted(axis: int, torque: float, error: float) -> Row:
    return str(axis + 1), significant(torque, 3), significant(error, 2), percent(error, torque)
