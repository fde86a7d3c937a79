"""Friction on the terminal: models by axis, symmetry, time constants."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

from hil.report.friction_rows import drift_rows, model_rows, symmetry_rows, words

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console

    from hil.estimation.friction.symmetry import Symmetry
    from hil.results.friction import FrictionResult

HEADINGS = {
    "models": ("axis", "model", "rms, N m", "held out", "", "parameters with std. errors"),
    "symmetry": ("axis", "n", "asymmetry, %", "std. error", "p (none)", "p (bound)", "verdict"),
    "drift": ("axis", "constant", "value, s", "std. error", "effect", ""),
}


def render(result: FrictionResult, console: Console) -> None:
    """Print everything that was found about friction."""
    title = f"{result.robot.name}: {len(result.points)} friction measurements"
    if result.axes:
        _print(console, "models", model_rows(result), f"{title}, gravity by {result.gravity}")
    for word in words(result):
        console.print(f"[yellow]{word}[/]", soft_wrap=True, highlight=False)
    render_symmetry(result.symmetry, console)
    if result.drifts:
        _print(console, "drift", drift_rows(result.drifts), "friction's variance in time")
    for told in result.left_out:
        console.print(f"[yellow]left out: {told}[/]", soft_wrap=True, highlight=False)


def render_symmetry(tests: Iterable[Symmetry], console: Console) -> None:
    """Print the symmetry test, if any axis was tested."""
    rows = symmetry_rows(tests)
    if rows:
        _print(console, "symmetry", rows, "is friction the same in both directions?")


def _print(console: Console, what: str, rows: list[tuple[str, ...]], title: str) -> None:
    table = Table(title=title, box=box.SIMPLE_HEAD, pad_edge=False)
    for number, heading in enumerate(HEADINGS[what]):
        last = number == len(HEADINGS[what]) - 1
        figures = not last and heading not in {"", "model", "constant"}
        table.add_column(heading, justify="right" if figures else "left", no_wrap=not last)
    for row in rows:
        if row[0] and table.row_count and what != "symmetry":
            table.add_section()
        table.add_row(*row)
    console.print(table)
