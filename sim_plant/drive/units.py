"""Units of a drive's profile objects, converted to the counts of its axis.

The counts of the axis are unbounded. A drive may show positions within a range (607Bh), as rotary
axes do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sim_plant.canopen.eds_variant import PER_RPM

if TYPE_CHECKING:
    from fractions import Fraction

    from sim_plant.drive_settings import DriveSettings


@dataclass(frozen=True, slots=True)
class Units:
    """Size of the units of the dictionary.

    Attributes
    ----------
    velocity, acceleration : float
        Units of velocity and acceleration [counts/s, counts/s^2].
    """

    velocity: float
    acceleration: float

    @classmethod
    def derive(cls, settings: DriveSettings) -> Units:
        """Derive the units from a drive's personality."""
        personality, counts = settings.personality, settings.counts_per_revolution
        return cls(
            _increments(personality.velocity_unit, counts),
            _increments(personality.acceleration_unit, counts),
        )


@dataclass(frozen=True, slots=True)
class Turns:
    """Range of shown positions, with or without wrap-around.

    Attributes
    ----------
    low, size : int
        Lowest shown position, and number of shown positions; 0 without wrap-around.
    """

    low: int
    size: int

    @classmethod
    def derive(cls, settings: DriveSettings) -> Turns:
        """Derive the range from a drive's personality."""
        low, high = settings.personality.position_range or (0, -1)
        return cls(low, high - low + 1)

    def shown(self, position: int) -> int:
        """Return the shown value of a position of the axis."""
        return self.low + (position - self.low) % self.size if self.size else position

    def nearest(self, target: int, position: int) -> int:
        """Return the position nearest to `position` with the shown value `target`."""
        if not self.size:
            return target
        half = self.size // 2
        return position + (target - position + half) % self.size - half

    def same_turn(self, target: int, position: int) -> int:
        """Return the position with the shown value `target` in the present turn."""
        return target + position - self.shown(position)


def _increments(unit: str, per_revolution: Fraction) -> float:
    per_rpm = PER_RPM[unit]
    return float(per_revolution) / 60 / per_rpm if per_rpm else 1
