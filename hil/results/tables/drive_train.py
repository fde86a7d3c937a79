"""What lies between each axis's current and the arm: lag, compliance, friction of the load."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.drive_train import compliance_units
from hil.estimation.simultaneous import SIGNIFICANT
from hil.results.rounding import uncertain
from hil.results.tables.table import Column, Marked, Part, Table, figures

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.results.tables.table import Row


def drive_train(estimate: Estimate, robot: Robot) -> Table:
    """Each axis's drive train as measured; no rows where nothing of it was estimated.

    Marked are compliances and friction of the load that the estimate takes into account.
    """
    return Table(
        title="Drive trains, with standard errors",
        columns=(
            Column("axis"),
            *figures(
                "lag, ms",
                "±",
                f"compliance, {compliance_units(robot)}",
                "±",
                "load friction, %",
                "±",
            ),
        ),
        parts=(Part(tuple(_axes(estimate))),) if estimate.drive_train else (),
    )


def _axes(estimate: Estimate) -> Iterator[Row]:
    train, load = estimate.drive_train, estimate.load_friction
    if train is None:
        return
    mu = np.full((2, len(train.lag)), np.nan) if load is None else np.array(load)
    for axis in range(len(train.lag)):
        yield (
            str(axis + 1),
            *_figure(1e3 * train.lag[axis], 1e3 * train.lag_error[axis]),
            *_figure(
                1e6 * train.compliance[axis], 1e6 * train.compliance_error[axis], train.soft[axis]
            ),
            *_figure(1e2 * mu[0, axis], 1e2 * mu[1, axis], mu[0, axis] > SIGNIFICANT * mu[1, axis]),
        )


def _figure(value: float, error: float, marked: bool = False) -> tuple[str | Marked, str]:
    if math.isnan(error):
        return "not identifiable", ""
    shown, of_error = uncertain(float(value), float(error))
    return (Marked(shown) if marked else shown), of_error
