"""An estimate on the terminal: parameters by group, residuals, what could not be used."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.tables.parameters import parameters
from hil.results.tables.terminal import show, show_remark
from hil.results.tables.torques import residuals

if TYPE_CHECKING:
    from rich.console import Console

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot


def render(estimate: Estimate, robot: Robot, console: Console) -> None:
    """Print parameters with their uncertainty, residuals, and what could not be used."""
    show(parameters(estimate, robot), console)
    show(residuals(estimate, robot), console)
    for left in estimate.left_out:
        show_remark(f"left out: {left}", console)
