"""Units of a drive's objects in SI, on the joint side.

The drive's units follow from the drives file (`drivers.axis`); this module assigns them to the
quantities of the objects, so that counts are converted in one way wherever limits are computed,
compared or shown.
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
    """Quantity of an object."""

    POSITION = auto()
    DISTANCE = auto()
    SPEED = auto()
    MOTOR_SPEED = auto()
    """Speed of the motor shaft, in revolutions per minute for any velocity unit."""
    ACCELERATION = auto()
    TORQUE = auto()
    """Per mille of rated torque."""
    CURRENT = auto()
    """Per mille of rated current, converted to torque."""


FIELDS = {
    Quantity.SPEED: "velocity",
    Quantity.MOTOR_SPEED: "velocity",
    Quantity.ACCELERATION: "acceleration",
    Quantity.TORQUE: "torque",
    Quantity.CURRENT: "torque",
}
"""Field of `drivers.drives_file.AxisLimits` for a limit of each quantity."""


class Measure(NamedTuple):
    """Unit of a quantity in a drive.

    Attributes
    ----------
    per_count : float
        Size of one count [`unit`]; of positions, with the sign of the axis.
    unit : str
        Unit in SI, joint side.
    counts : callable
        Converts a value [`unit`] to counts for writing.
    zero : int
        Count at value 0.
    """

    per_count: float
    unit: str
    counts: Callable[[float], int]
    zero: int = 0

    def value(self, counts: int) -> float:
        """Convert counts to a value [`unit`]."""
        return (counts - self.zero) * self.per_count


def measures(axis: AxisDrive) -> Mapping[Quantity, Measure]:
    """Return the unit of each quantity in the drive of an axis."""
    scale = AxisScale.derive(axis)
    length, force = axis.unit, axis.effort_unit
    increment, rpm = abs(scale.position), 2 * math.pi / 60 / axis.gear_ratio
    of_current = axis.current.basis is Basis.RATED_CURRENT
    per_current = abs(scale.torque) / axis.current.per_count if of_current else scale.torque_limit
    speed, acceleration = f"{length}/s", f"{length}/s^2"
    torque = scale.torque_limit_to_counts
    return {
        Quantity.POSITION: Measure(scale.position, length, scale.position_to_counts, scale.zero),
        Quantity.DISTANCE: Measure(increment, length, lambda distance: round(distance / increment)),
        Quantity.SPEED: Measure(scale.velocity, speed, scale.velocity_to_counts),
        Quantity.MOTOR_SPEED: Measure(rpm, speed, lambda v: math.ceil(v / rpm * (1 - 1e-9))),
        Quantity.ACCELERATION: Measure(
            scale.acceleration, acceleration, scale.acceleration_to_counts
        ),
        Quantity.TORQUE: Measure(scale.torque_limit, force, torque),
        Quantity.CURRENT: Measure(per_current, force, torque),
    }
