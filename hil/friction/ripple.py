"""Which multiples of a motor's angle a regression can hold torque ripple at.

Torques of links are polynomials of second degree in the sines and cosines of the joint angles, and
so is everything that an offset, gravity and inertias say of an axis. Ripple at an order n of the
motor's angle is a sine of the joint's angle times n times the gear ratio. Behind a gear that is far
beyond: nothing else looks like it. On a direct drive the first orders are columns of gravity and
inertia themselves, and where a motor makes less than a turn over the whole range of its joint all
orders look like each other and like an offset. Such orders are left out: as much as there is of
this ripple becomes part of the base parameters, which no measurement can prevent.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot

RIPPLE_ORDERS = range(1, 7)
"""Multiples of the motor's angle: unbalance, misalignment, poles and slots of common motors."""


def ripple_orders(robot: Robot, axis: int) -> tuple[int, ...]:
    """Orders of `RIPPLE_ORDERS` at which ripple of an axis can be distinguished; axis from 0."""
    gear = float(robot.gear_ratio[axis])
    turns = gear * float(robot.q_max[axis] - robot.q_min[axis]) / math.tau
    # turns of a motor over its joint's range below which its orders cannot be distinguished
    if not (np.isfinite(gear) and turns >= 1.0):
        return ()
    # least multiple of the joint's angle that counts as ripple: twice that of the fastest torque
    # of links
    least = 4.0 if robot.revolute[axis] else 0.0
    return tuple(n for n in RIPPLE_ORDERS if n * gear >= least)


def multiples(angle: NDArray[np.float64], orders: range) -> NDArray[np.complex128]:
    """exp(j n angle) of successive orders n, shape (n_orders, n): cosines and sines."""
    once = np.empty(len(angle), dtype=complex)
    once.real, once.imag = np.cos(angle), np.sin(angle)
    found = np.empty((len(orders), len(angle)), dtype=complex)
    found[0] = once ** orders[0]
    for lower, higher in pairwise(found):
        np.multiply(lower, once, out=higher)
    return found


def orders_left_out(robot: Robot) -> dict[int, tuple[int, ...]]:
    """Orders that the regression does not hold, by axis from 0; only axes that have some."""
    kept = {axis: set(ripple_orders(robot, axis)) for axis in range(robot.n_joints)}
    left = {axis: tuple(n for n in RIPPLE_ORDERS if n not in own) for axis, own in kept.items()}
    return {axis: orders for axis, orders in left.items() if orders}


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
