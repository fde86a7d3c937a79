"""A conventional estimate on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

from hil.model.base_parameters import base_parameters
from hil.results.rounding import rounded

if TYPE_CHECKING:
    from rich.console import Console

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot


def render(estimate: Estimate, robot: Robot, console: Console) -> None:
    """Print parameters with their standard errors, residuals and condition number."""
    base = base_parameters(robot)
    table = Table(title=f"{robot.name}: {estimate.method}", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    for heading in ("value", "std. error", "± 95 %"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("unit")
    half = estimate.half_width()
    for members in base.groups.values():
        for k in members:
            error = float(estimate.standard_error[k])
            cells = (rounded(float(v), error) for v in (estimate.p[k], error, half[k]))
            table.add_row(base.names[k], *cells, base.units[k])
        table.add_section()
    console.print(table)
    left = ", ".join(f"{value:.3g}" for value in estimate.residual)
    console.print(
        f"condition number {estimate.condition['all']:.3g}; torque left, axis 1 to"
        f" {robot.n_joints}: {left} N m rms",
        highlight=False,
        soft_wrap=True,
    )
