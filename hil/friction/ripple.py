"""Orders of torque ripple that a regression can distinguish from rigid-body torques.

Torques of the links, gravity and offset included, are polynomials of second degree in the sines and
cosines of the joint angles. Ripple of order n is a sine of the joint angle times n times the gear
ratio. Behind a gear this frequency is far above those of all rigid-body columns. On a direct drive
the first orders are columns of gravity and inertia, and if a motor makes less than one turn over
the range of the joint, all orders resemble each other and an offset. Such orders are not fitted:
ripple of these orders becomes part of the base parameters, which no measurement can prevent.
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
"""Multiples of the motor angle: unbalance, misalignment, poles and slots of common motors."""


def ripple_orders(robot: Robot, axis: int) -> tuple[int, ...]:
    """Return the orders of `RIPPLE_ORDERS` that are distinguishable on an axis (from 0)."""
    gear = float(robot.gear_ratio[axis])
    turns = gear * float(robot.q_max[axis] - robot.q_min[axis]) / math.tau
    # with less than one turn of the motor, the orders resemble each other
    if not (np.isfinite(gear) and turns >= 1.0):
        return ()
    # rigid-body torques reach twice the joint angle; ripple must have twice that frequency
    least = 4.0 if robot.revolute[axis] else 0.0
    return tuple(n for n in RIPPLE_ORDERS if n * gear >= least)


def multiples(angle: NDArray[np.float64], orders: range) -> NDArray[np.complex128]:
    """Return exp(j n angle) for successive orders n, shape (n_orders, n): cosines and sines."""
    once = np.empty(len(angle), dtype=complex)
    once.real, once.imag = np.cos(angle), np.sin(angle)
    found = np.empty((len(orders), len(angle)), dtype=complex)
    found[0] = once ** orders[0]
    for lower, higher in pairwise(found):
        np.multiply(lower, once, out=higher)
    return found


def orders_left_out(robot: Robot) -> dict[int, tuple[int, ...]]:
    """Return the orders without columns in the regression, by axis from 0."""
    kept = {axis: set(ripple_orders(robot, axis)) for axis in range(robot.n_joints)}
    left = {axis: tuple(n for n in RIPPLE_ORDERS if n not in own) for axis, own in kept.items()}
    return {axis: orders for axis, orders in left.items() if orders}


def ripple_left_out(robot: Robot) -> str:
    """State the orders without columns for each axis, and the reason; empty if none."""
    found = orders_left_out(robot)
    if not found:
        return ""
    said = []
    for axis, (first, *more) in found.items():
        ratio = robot.gear_ratio[axis]
        stated = f"{ratio:g}" if math.isfinite(ratio) else "unknown"
        orders = f"{first} to {more[-1]}" if more else str(first)
        said.append(f"axis {axis + 1}, gear ratio {stated}: {orders}")
    return (
        "torque ripple is not fitted at these multiples of the motor's angle: "
        f"{'; '.join(said)}. They cannot be distinguished from gravity, inertia or each other; "
        "such ripple becomes part of the base parameters"
    )
