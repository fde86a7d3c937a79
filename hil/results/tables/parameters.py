"""Base parameters with their uncertainty, and the same by two methods."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.results.rounding import percent, rounded, signed
from hil.results.tables.cells import uncertain, unit
from hil.results.tables.table import Column, Marked, Part, Table, figures

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.results.prediction import Prediction
    from hil.results.tables.table import Row

DISAGREEMENT = 3.0
"""Standard errors between two methods from which on their difference is marked."""
NAME = Column("", symbols=True)
EFFECT = Column("of torque")


def parameters(estimate: Estimate, robot: Robot, prediction: Prediction | None = None) -> Table:
    """Table 3 with uncertainties, by group; with `prediction` also what they mean in torques."""
    base = base_parameters(robot)
    rows = [_parameter(estimate, robot, k, prediction) for k in range(len(base))]
    return Table(
        title=f"{robot.name}: {len(estimate.local)} measurements, {estimate.method} method",
        columns=(
            NAME,
            *figures("value", "std. error", "95 % interval", "%", "d.o.f."),
            *([EFFECT] if prediction else []),
            Column("unit"),
            Column("expression", folds=True, symbols=True),
        ),
        parts=tuple(
            Part(tuple(rows[k] for k in members), _name(group, estimate.condition[group]))
            for group, members in base.groups.items()
            if members
        ),
        explanation=(
            "Standard errors (also in per cent), and intervals of 95 % with their effective degrees of freedom, d.o.f."
            + (
                " One standard error is carried to the torques of a free motion too: the joint"
                " where it matters most, relative to that joint's rms torque."
                if prediction
                else ""
            )
        ),
    )  # fmt: skip


def _name(group: str, condition: float) -> str:
    return f"{group.replace('_', '-')}, condition number {condition:.3g}"


def _parameter(estimate: Estimate, robot: Robot, k: int, prediction: Prediction | None) -> Row:
    base = base_parameters(robot)
    value, error = float(estimate.p[k]), float(estimate.standard_error[k])
    half = float(estimate.half_width()[k])
    return (
        base.names[k],
        *uncertain(value, error),
        f"{rounded(value - half, error)} … {rounded(value + half, error)}",
        percent(error, value),
        f"{estimate.degrees_of_freedom[k]:.1f}",
        *([_effect(prediction, k)] if prediction else []),
        unit(base.units[k]),
        base.expressions[k],
    )


def _effect(prediction: Prediction, k: int) -> str:
    effect = np.nan_to_num(prediction.relative_effect[:, k])
    joint = int(np.argmax(effect))
    return f"{percent(float(effect[joint]), 1.0)} % of joint {joint + 1}"


def methods(estimate: Estimate, check: Estimate, robot: Robot) -> Table:
    """Both estimates side by side; differences beyond `DISAGREEMENT` stand out."""
    base = base_parameters(robot)
    return Table(
        title=f"{robot.name}: {estimate.method} and {check.method} method",
        columns=(
            NAME,
            Column("unit"),
            *figures(estimate.method, "std. error", check.method, "std. error"),
            *figures("difference", "in std. errors"),
        ),
        parts=tuple(
            Part(tuple(_method(estimate, check, robot, k) for k in members))
            for members in base.groups.values()
            if members
        ),
    )


def _method(estimate: Estimate, check: Estimate, robot: Robot, k: int) -> Row:
    base = base_parameters(robot)
    difference = float(check.p[k] - estimate.p[k])
    errors = float(estimate.standard_error[k]), float(check.standard_error[k])
    ratio = difference / math.hypot(*errors)
    shown = signed(f"{ratio:.1f}")
    return (
        base.names[k],
        unit(base.units[k]),
        *uncertain(float(estimate.p[k]), errors[0]),
        *uncertain(float(check.p[k]), errors[1]),
        rounded(difference, errors[1]),
        Marked(shown) if abs(ratio) > DISAGREEMENT else shown,
    )
