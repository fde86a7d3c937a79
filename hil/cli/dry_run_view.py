"""A dry run's answer on the terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.table import Table

from checked_files.yaml_file import line_of
from hil.planning.measurement import FOR_A_LAW
from hil.results.rounding import clock

if TYPE_CHECKING:
    from rich.console import Console

    from hil.planning.dry_run import DryRun

SHOWN = 10
"""Problems that are shown one by one."""


def render(result: DryRun, console: Console) -> None:
    """Print what a plan will cost and what it will give."""
    console.print(_costs(result))
    if result.bus:
        console.print(
            f"bus load {result.bus_load:.1%} at {result.bus.bitrate / 1000:g} kbit/s"
            f" ({result.bus.frames}; at most {result.bus.most:.0%})",
            soft_wrap=True,
        )
    for axis, planned in result.without_law.items():
        console.print(
            f"[yellow]axis {axis + 1}: {planned} measurements move it, a law of its friction needs"
            f" {FOR_A_LAW}; torques will lack its friction; add measurements that move it[/]",
            soft_wrap=True,
        )
    if result.groups:
        console.print(_gains(result))
        for group in result.groups:
            if group.poorly_identifiable:
                names = ", ".join(group.poorly_identifiable)
                console.print(
                    f"[yellow]poorly identifiable in {_words(group.group)}: {names}; vary more"
                    " joints or add configurations[/]",
                    soft_wrap=True,
                )
            if group.hidden:
                names = ", ".join(group.hidden)
                console.print(
                    f"{names}: acceleration shows what no gravity torque distinguishes from an"
                    " offset or from each other; condition and rank are those of all kinds of"
                    " measurement together",
                    soft_wrap=True,
                )


def describe_problems(result: DryRun, text: str, source: str) -> str:
    """Return one line for each problem, with its place in the plan's `text`."""
    lines = [
        f"{source}:{line_of(text, problem.location)}:"
        f" {'.'.join(map(str, problem.location))}: {problem.message}"
        for problem in result.problems[:SHOWN]
    ]
    more = len(result.problems) - SHOWN
    return "\n".join([*lines, f"... and {more} more of that kind"] if more > 0 else lines)


def _costs(result: DryRun) -> Table:
    table = Table("", "measurements", "robot time", title="What it will take")
    for kind, duration in result.durations.items():
        table.add_row(kind, str(result.counts.get(kind, "")), clock(duration))
    table.add_section()
    table.add_row("total", str(sum(result.counts.values())), clock(result.duration))
    return table


def _gains(result: DryRun) -> Table:
    table = Table(
        "group",
        "parameters",
        "measurements",
        "rank",
        "condition",
        title="What can be identified",
    )
    for group in result.groups:
        condition = f"{group.condition:.1f}" if math.isfinite(group.condition) else "infinite"
        table.add_row(
            _words(group.group),
            ", ".join(group.names),
            str(group.rows),
            f"{group.rank} of {len(group.names)}",
            condition,
        )
    return table


def _words(group: str) -> str:
    return group.replace("_", "-")
