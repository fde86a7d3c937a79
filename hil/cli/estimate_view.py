"""An estimate on the terminal: parameters by group, residuals, what could not be used."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich import box
from rich.table import Table

from hil.model.base_parameters import base_parameters
from hil.results.rounding import percent, rounded, significant

if TYPE_CHECKING:
    from rich.console import Console

    from hil.estimation.estimate import Estimate
    from hil.model.base_parameters import BaseParameters
    from hil.model.robot import Robot


def render(estimate: Estimate, robot: Robot, console: Console) -> None:
    """Print parameters with their uncertainty, residuals, and what could not be used."""
    console.print(_parameters(estimate, robot))
    console.print(_residuals(estimate, robot))
    for told in estimate.left_out:
        console.print(f"[yellow]left out: {told}[/]", soft_wrap=True)


def _parameters(estimate: Estimate, robot: Robot) -> Table:
    base = base_parameters(robot)
    conditions = ", ".join(
        f"{group.replace('_', '-')} {value:.3g}" for group, value in estimate.condition.items()
    )
    table = Table(
        title=f"{robot.name}: {len(estimate.local)} measurements, {estimate.method} method",
        caption=f"condition numbers: {conditions}",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    for heading in ("", "value", "std. error", "± 95 %", "%"):
        table.add_column(heading, no_wrap=True, justify="right" if heading else "left")
    table.add_column("unit", no_wrap=True)
    table.add_column("expression", overflow="fold")
    for group, members in base.groups.items():
        if members:
            table.add_row(*[""] * 6, f"[bold]{group.replace('_', '-')}[/bold]")
        for k in members:
            table.add_row(*_cells(estimate, base, k))
        table.add_section()
    return table


def _cells(estimate: Estimate, base: BaseParameters, k: int) -> tuple[str, ...]:
    value, error = float(estimate.p[k]), float(estimate.standard_error[k])
    return (
        base.names[k],
        rounded(value, error),
        rounded(error, error),
        rounded(float(estimate.half_width()[k]), error),
        percent(error, value),
        base.units[k],
        base.expressions[k],
    )


def _residuals(estimate: Estimate, robot: Robot) -> Table:
    """What the local models leave of each axis's torque, and how much that is of its limit."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("torque left by the local models, axis")
    for heading in ("rms, N m", "% of limit"):
        table.add_column(heading, justify="right")
    for axis, residual in enumerate(estimate.residual):
        if np.isnan(residual):
            table.add_row(str(axis + 1), "not measured", "")
        else:
            limit = robot.torque_limit[axis]
            table.add_row(str(axis + 1), significant(float(residual), 3), percent(residual, limit))
    return table
