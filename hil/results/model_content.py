"""What was identified of a robot, as the content of `model.yaml`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.results.model_file import ModelFile, Parameter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.results.identified_robot import IdentifiedRobot

    Array = NDArray[np.float64]


def model_content(model: IdentifiedRobot) -> ModelFile:
    """Return what the file of a model holds."""
    return ModelFile(
        provenance=model.provenance,
        parameters=_parameters(model),
        covariance=_rows(model.covariance),
        drive_covariance=_rows(model.drive_covariance),
        degrees_of_freedom=tuple(model.degrees_of_freedom.tolist()),
        residual=tuple(None if np.isnan(r) else float(r) for r in model.residual),
        condition=model.condition,
        error_budget=model.error_budget,
        friction=model.friction,
        back_and_forth=model.back_and_forth,
        outcome=model.outcome,
        friction_law=None if model.friction else model.friction_law,
        validations=model.validations,
        consistent=model.consistent,
        robot_file=model.robot.text,
        torque_effect=None if model.torque_effect is None else _rows(model.torque_effect),
    )


def _parameters(model: IdentifiedRobot) -> tuple[Parameter, ...]:
    base = base_parameters(model.robot)
    group_of = {index: group for group, members in base.groups.items() for index in members}
    errors, intervals = model.standard_errors.tolist(), model.interval().tolist()
    identified = model.identified.tolist()
    return tuple(
        Parameter(
            name=base.names[k],
            expression=base.expressions[k],
            group=group_of[k],
            unit=base.units[k],
            value=value,
            standard_error=errors[k] if identified[k] else None,
            interval_95=tuple(intervals[k]) if identified[k] else None,
        )
        for k, value in enumerate(model.values.tolist())
    )


def _rows(matrix: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix.tolist())
