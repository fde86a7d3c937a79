"""Units of a drive's profile objects, turned into the counts that its axis understands."""

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


def _increments(unit: str, per_revolution: Fraction) -> float:
    per_rpm = PER_RPM[unit]
    return float(per_revolution) / 60 / per_rpm if per_rpm else 1
