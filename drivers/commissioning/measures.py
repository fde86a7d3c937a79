"""What one count of an object of a drive is, joint side and in SI.

The drive's units follow from the drives file (`drivers.axis`); here they get the names of what the
objects of a drive state in them, so that a count is turned into SI in one way wherever limits are
computed, compared or shown.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import TYPE_CHECKING, NamedTuple

from drivers.axis import AxisScale
from drivers.drives_file import Basis

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from drivers.drives_file import AxisDrive


class Quantity(Enum):
    """What an object counts."""

    POSITION = auto()
    DISTANCE = auto()
    SPEED = auto()
    MOTOR_SPEED = auto()
    """Of the motor's shaft, in revolutions per minute whatever the unit of velocities."""
    ACCELERATION = auto()
    TORQUE = auto()
    """Per mille of rated torque."""
    CURRENT = auto()
    """Per mille of rated current, by the torque that it makes."""


FIELDS = {
    Quantity.SPEED: "velocity",
    Quantity.MOTOR_SPEED: "velocity",
    Quantity.ACCELERATION: "acceleration",
    Quantity.TORQUE: "torque",
    Quantity.CURRENT: "torque",
}
"""Field of `drivers.drives_file.AxisLimits` that a limit of each quantity is one of."""


class Measure(NamedTuple):
    """How an object counts a quantity of one axis.

    Attributes
    ----------
    per_count : float
        One count [`unit`]; of positions with the sign of the axis.
    unit : str
        In SI, joint side.
    counts : callable
        Returns the count for a value [`unit`] that is to be written.
    zero : int
        Count at value 0.
    """

    per_count: float
    unit: str
    counts: Callable[[float], int]
    zero: int = 0

    def value(self, counts: int) -> float:
        """Return what a count is [`unit`]."""
        return (counts - self.zero) * self.per_count


def measures(axis: AxisDrive) -> Mapping[Quantity, Measure]:
    """Return how the drive of an axis counts each quantity."""
    scale = AxisScale.derive(axis)
    length, force = axis.unit, axis.effort_unit
    increment, rpm = abs(scale.position), 2 * math.pi / 60 / axis.gear_ratio
    of_current = axis.current.basis is Basis.RATED_CURRENT
    per_current = abs(scale.torque) / axis.current.per_count if of_current else scale.torque_limit
    speed, acceleration = f"{length}/s", f"{length}/s^2"
    torque = scale.torque_limit_to_counts
    return {
        Quantity.POSITION: Measure(scale.position, length, scale.position_to_counts, scale.zero),
        Quantity.DISTANCE: Measure(increment, length, lambda way: round(way / increment)),
        Quantity.SPEED: Measure(scale.velocity, speed, scale.velocity_to_counts),
        Quantity.MOTOR_SPEED: Measure(rpm, speed, lambda v: math.ceil(v / rpm * (1 - 1e-9))),
        Quantity.ACCELERATION: Measure(
            scale.acceleration, acceleration, scale.acceleration_to_counts
        ),
        Quantity.TORQUE: Measure(scale.torque_limit, force, torque),
        Quantity.CURRENT: Measure(per_current, force, torque),
    }
