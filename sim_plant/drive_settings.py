"""Individual settings of a drive: identity, ratings, limits, personality.

The rest of the object dictionary is common to all drives and is given by the EDS. Units are those
of the objects, neither joint side nor SI.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from sim_plant.personality import PLAIN, Personality


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """Identity, ratings and limits of a drive.

    Attributes
    ----------
    name : str
        Label of the axis (2000h).
    node_id : int
        CANopen node, 1 to 127.
    vendor_id, product_code, revision, serial : int
        Identity (1018h).
    rated_current : int
        6075h [mA].
    rated_torque : int
        6076h, of the motor [mN m].
    max_torque : int
        6072h and 6073h; the highest value that they accept [per mille of rated].
    increments_per_revolution : int
        Encoder increments per motor revolution (608Fh).
    gear : tuple of int
        6091h: motor revolutions to shaft revolutions.
    software_limits : tuple of int
        607Dh: lowest and highest target [counts]; off unless the lowest is below the highest.
    max_motor_speed : int
        6080h [rev/min].
    max_acceleration : int
        60C5h and 60C6h [counts/s^2].
    personality : Personality
        Deviations of the drive.
    axis : int
        Number of the axis in the node, from 1.
    """

    name: str
    node_id: int
    vendor_id: int
    product_code: int
    revision: int
    serial: int
    rated_current: int
    rated_torque: int
    max_torque: int
    increments_per_revolution: int
    gear: tuple[int, int]
    software_limits: tuple[int, int]
    max_motor_speed: int
    max_acceleration: int
    personality: Personality = PLAIN
    axis: int = 1

    @property
    def feed(self) -> tuple[int, int]:
        """Counts, and the revolutions of the shaft with as many counts (6092h)."""
        own = self.personality.counts_per_turn
        motor, shaft = self.gear
        return (self.increments_per_revolution * motor, shaft) if own is None else (own, 1)

    @property
    def counts_per_revolution(self) -> Fraction:
        """Counts of positions per revolution of the motor."""
        return Fraction(*self.feed) / Fraction(*self.gear)

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= 127:
            raise ValueError(f"{self.name}: node id {self.node_id} must be in 1...127")
        if self.increments_per_revolution * self.gear[0] >= 1 << 32:
            raise ValueError(
                f"{self.name}: gear {self.gear[0]}:{self.gear[1]} does not fit 6092h; "
                "write the ratio in smaller numbers"
            )
