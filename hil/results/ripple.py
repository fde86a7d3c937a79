"""Torque ripple that no regression can hold, in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hil.least_squares.ripple import orders_left_out

if TYPE_CHECKING:
    from hil.model.robot import Robot


def ripple_left_out(robot: Robot) -> str:
    """State which orders are left out at which axes, and why; empty where none is."""
    found = orders_left_out(robot)
    if not found:
        return ""
    axes = "; ".join(
        f"axis {axis + 1}, gear ratio {_stated(robot.gear_ratio[axis])}: {_listed(orders)}"
        for axis, orders in found.items()
    )
    return (
        f"torque ripple is not fitted at these multiples of the motor's angle: {axes}. They cannot"
        " be distinguished from gravity, inertia or each other; what there is of it becomes part"
        " of the base parameters"
    )


def _stated(ratio: float) -> str:
    return f"{ratio:g}" if math.isfinite(ratio) else "unknown"


def _listed(orders: tuple[int, ...]) -> str:
    """Orders that follow each other, as a range."""
    return str(orders[0]) if len(orders) == 1 else f"{orders[0]} to {orders[-1]}"
