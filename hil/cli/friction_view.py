"""Friction on the terminal: models by axis, symmetry, time constants."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.tables.friction import drift, models, symmetry
from hil.results.tables.terminal import show, show_remark

if TYPE_CHECKING:
    from rich.console import Console

    from hil.results.friction_file import FrictionResult


def render(result: FrictionResult, console: Console) -> None:
    """Print everything that was found about friction."""
    for table in (models(result), symmetry(result.symmetry), drift(result.drifts)):
        show(table, console)
    for left in result.left_out:
        show_remark(f"left out: {left}", console)
