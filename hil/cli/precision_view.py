"""Predicted standard deviations on the terminal: of a plan, and of what to measure next.

The last column is the torque that a standard deviation amounts to, of the torque limit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

from hil.model.base_parameters import base_parameters
from hil.planning.prediction.precision import IMPRECISE
from hil.results.rounding import rounded, significant, unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from hil.model.robot import Robot
    from hil.planning.prediction.precision import Precision


def render(found: Precision, robot: Robot, console: Console) -> None:
    """Print how precisely a plan will identify every base parameter."""
    table = _table("How precisely, predicted", ("std. deviation",))
    for group, members in base_parameters(robot).groups.items():
        _head(table, group, members)
        for k in members:
            table.add_row(
                found.names[k],
                _figure(found.deviation[k]),
                unit(found.units[k]),
                *_weight(found, k),
            )
        table.add_section()
    console.print(table)
    _foot(found, console)


def render_refinement(before: Precision, after: Precision, robot: Robot, console: Console) -> None:
    """Print what is known and what will be known with the measurements proposed."""
    table = _table("Predicted standard deviations", ("now", "then", "then / now"))
    for group, members in base_parameters(robot).groups.items():
        _head(table, group, members)
        for k in members:
            now, then = float(before.deviation[k]), float(after.deviation[k])
            share = f"{then / now:.2f}" if math.isfinite(now) else ""
            cells = (_figure(now), _figure(then), share, unit(after.units[k]))
            table.add_row(after.names[k], *cells, *_weight(after, k))
        table.add_section()
    console.print(table)
    _foot(after, console)


def _table(title: str, figures: Sequence[str]) -> Table:
    table = Table(title=title, box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    for heading in figures:
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("torque, %", justify="right", no_wrap=True)
    table.add_column("")
    return table


def _head(table: Table, group: str, members: Sequence[int]) -> None:
    if members:
        table.add_row(f"[bold]{group.replace('_', '-')}[/bold]")


def _figure(deviation: float) -> str:
    return rounded(deviation, deviation) if math.isfinite(deviation) else "not identifiable"


def _weight(found: Precision, k: int) -> tuple[str, str]:
    """What a standard deviation means, and whether that is much."""
    effect = float(found.effect[k])
    figure = significant(100 * effect, 2) if math.isfinite(effect) else ""
    return figure, "[yellow]imprecise[/]" if found.imprecise[k] else ""


def _foot(found: Precision, console: Console) -> None:
    console.print(
        f"torque: what a standard deviation amounts to, of an axis's limit; {found.source}",
        soft_wrap=True,
        highlight=False,
    )
    imprecise = ", ".join(
        name for name, it_is in zip(found.names, found.imprecise, strict=True) if it_is
    )
    if imprecise:
        console.print(
            f"[yellow]imprecise: {imprecise}; a standard deviation is more than {IMPRECISE:.1%}"
            " of a torque limit. Give more minutes, or measure on with hil plan --refine[/]",
            soft_wrap=True,
        )
