"""An identified model on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

if TYPE_CHECKING:
    from rich.console import Console

    from hil.model_file import ModelFile, Parameter


def render(model: ModelFile, console: Console) -> None:
    """Print parameters with their 95 % intervals, by group, and what was left out."""
    origin = model.provenance
    table = Table(
        title=f"{origin.robot}: {origin.measurements} measurements, {origin.method} method"
    )
    for heading in ("", "value", "+- (95 %)", "unit"):
        table.add_column(
            heading, no_wrap=True, justify="left" if heading in {"", "unit"} else "right"
        )
    table.add_column("expression", overflow="fold")
    for group, condition in model.condition.items():
        table.add_section()
        title = f"[bold]{group.replace('_', '-')}, condition number {condition:.3g}[/bold]"
        table.add_row("", "", "", "", title)
        for parameter in model.parameters:
            if parameter.group == group:
                table.add_row(*_cells(parameter))
    console.print(table)
    for told in origin.left_out:
        console.print(f"[yellow]left out: {told}[/]", soft_wrap=True)


def _cells(parameter: Parameter) -> tuple[str, ...]:
    low, high = parameter.interval_95
    return (
        parameter.name,
        f"{parameter.value:.4f}",
        f"{(high - low) / 2:.4f}",
        parameter.unit,
        parameter.expression,
    )
