"""A model as tables: parameters by group, torques left over, measurements that were not used."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.results.rounding import percent, rounded, significant
from hil.results.summary import Part, Summary, Table

if TYPE_CHECKING:
    from hil.results.model import Model
    from hil.results.summary import Row

HEADINGS = ("", "value", "std. error", "± 95 %", "%", "unit", "expression")


def summary(model: Model) -> Summary:
    """Everything that a terminal or a notebook shows of a model."""
    remarks = tuple(f"left out: {left}" for left in model.provenance.left_out)
    return Summary((_parameters(model), _residuals(model)), remarks)


def _parameters(model: Model) -> Table:
    base, origin = base_parameters(model.robot), model.provenance
    half = np.diff(model.interval())[:, 0] / 2
    errors = model.standard_errors
    rows = [
        (
            name,
            rounded(float(model.values[k]), float(errors[k])),
            rounded(float(errors[k]), float(errors[k])),
            rounded(float(half[k]), float(errors[k])),
            percent(float(errors[k]), float(model.values[k])),
            base.units[k],
            base.expressions[k],
        )
        for k, name in enumerate(base.names)
    ]
    return Table(
        title=f"{model.robot.name}: {origin.measurements} measurements, {origin.method} method",
        headings=HEADINGS,
        figures=frozenset(range(1, 5)),
        parts=tuple(
            Part(group.replace("_", "-"), tuple(rows[k] for k in members))
            for group, members in base.groups.items()
            if members
        ),
        caption="condition numbers: "
        + ", ".join(f"{of.replace('_', '-')} {x:.3g}" for of, x in model.condition.items()),
    )


def _residuals(model: Model) -> Table:
    """What the method's models leave of each axis's torque, and how much that is of its limit."""
    return Table(
        title="",
        headings=("torque left by the fit, axis", "rms, N m", "% of limit"),
        figures=frozenset((1, 2)),
        parts=(Part("", tuple(_residual(model, axis) for axis in range(model.robot.n_joints))),),
    )


def _residual(model: Model, axis: int) -> Row:
    residual, limit = float(model.residual[axis]), float(model.robot.torque_limit[axis])
    if np.isnan(residual):
        return str(axis + 1), "not measured", ""
    return str(axis + 1), significant(residual, 3), percent(residual, limit)
