"""Units of a drive's profile objects, turned into the counts that its axis understands.

The axis counts on for ever; a drive may show that within a range (607Bh), as those of rotary axes.
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
    """What one unit of the dictionary is worth.

    Attributes
    ----------
    velocity, acceleration : float
        [counts/s, counts/s^2].
    """

    velocity: float
    acceleration: float

    @classmethod
    def of(cls, settings: DriveSettings) -> Units:
        """Units of a drive's personality."""
        personality, counts = settings.personality, settings.counts_per_revolution
        return cls(
            _increments(personality.velocity_unit, counts),
            _increments(personality.acceleration_unit, counts),
        )


@dataclass(frozen=True, slots=True)
class Turns:
    """Positions that wrap around within a range, or do not.

    Attributes
    ----------
    low, size : int
        The lowest position that is shown, and how many there are; 0 where nothing wraps.
    """

    low: int
    size: int

    @classmethod
    def of(cls, settings: DriveSettings) -> Turns:
        """Range of a drive's personality."""
        low, high = settings.personality.position_range or (0, -1)
        return cls(low, high - low + 1)

    def shown(self, position: int) -> int:
        """Return how a position of the axis is shown."""
        return self.low + (position - self.low) % self.size if self.size else position

    def nearest(self, target: int, position: int) -> int:
        """Return the place nearest to `position` that is shown as `target`."""
        if not self.size:
            return target
        half = self.size // 2
        return position + (target - position + half) % self.size - half

    def same_turn(self, target: int, position: int) -> int:
        """Return the place that is shown as `target` in the turn that the axis is in."""
        return target + position - self.shown(position)


def _increments(unit: str, per_revolution: Fraction) -> float:
    per_rpm = PER_RPM[unit]
    return float(per_revolution) / 60 / per_rpm if per_rpm else 1
