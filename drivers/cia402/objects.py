"""Objects of the drive profile (CiA 402) used by the driver, by name.

Quantities without a standard object have manufacturer objects, by vendor (1018:01). Included are
only objects named in a maker's dictionary with a unit in the manual; the same index of another
vendor has no meaning.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.fieldbus import Entry

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive

# CiA 301 objects common to every fieldbus of the profile
DEVICE_TYPE = Entry(0x1000, 0, "u32", "device type")
ERROR_HISTORY = Entry(0x1003, 1, "u32", "latest error")
VENDOR = Entry(0x1018, 1, "u32", "vendor")
PRODUCT = Entry(0x1018, 2, "u32", "product code")
REVISION = Entry(0x1018, 3, "u32", "revision number")
SERIAL = Entry(0x1018, 4, "u32", "serial number")
IDENTITY = (VENDOR, PRODUCT, REVISION, SERIAL)

ABORT_CONNECTION_OPTION = Entry(0x6007, 0, "i16", "abort connection option code")
ERROR_CODE = Entry(0x603F, 0, "u16", "error code")
CONTROLWORD = Entry(0x6040, 0, "u16", "controlword")
STATUSWORD = Entry(0x6041, 0, "u16", "statusword")
QUICK_STOP_OPTION = Entry(0x605A, 0, "i16", "quick stop option code")
HALT_OPTION = Entry(0x605D, 0, "i16", "halt option code")
MODE = Entry(0x6060, 0, "i8", "modes of operation")
MODE_DISPLAY = Entry(0x6061, 0, "i8", "modes of operation display")
POSITION = Entry(0x6064, 0, "i32", "position actual value")
FOLLOWING_ERROR_WINDOW = Entry(0x6065, 0, "u32", "following error window")
FOLLOWING_ERROR_TIME = Entry(0x6066, 0, "u16", "following error time out")
POSITION_WINDOW = Entry(0x6067, 0, "u32", "position window")
POSITION_WINDOW_TIME = Entry(0x6068, 0, "u16", "position window time")
MAX_TORQUE = Entry(0x6072, 0, "u16", "max torque")
MAX_CURRENT = Entry(0x6073, 0, "u16", "max current")
RATED_CURRENT = Entry(0x6075, 0, "u32", "motor rated current")
RATED_TORQUE = Entry(0x6076, 0, "u32", "motor rated torque")
TARGET_POSITION = Entry(0x607A, 0, "i32", "target position")
POSITION_RANGE_MIN = Entry(0x607B, 1, "i32", "min position range limit")
POSITION_RANGE_MAX = Entry(0x607B, 2, "i32", "max position range limit")
HOME_OFFSET = Entry(0x607C, 0, "i32", "home offset")
SOFTWARE_LIMIT_MIN = Entry(0x607D, 1, "i32", "min position limit")
SOFTWARE_LIMIT_MAX = Entry(0x607D, 2, "i32", "max position limit")
MAX_PROFILE_VELOCITY = Entry(0x607F, 0, "u32", "max profile velocity")
MAX_MOTOR_SPEED = Entry(0x6080, 0, "u32", "max motor speed")
PROFILE_VELOCITY = Entry(0x6081, 0, "u32", "profile velocity")
PROFILE_ACCELERATION = Entry(0x6083, 0, "u32", "profile acceleration")
PROFILE_DECELERATION = Entry(0x6084, 0, "u32", "profile deceleration")
QUICK_STOP_DECELERATION = Entry(0x6085, 0, "u32", "quick stop deceleration")
PROFILE_TYPE = Entry(0x6086, 0, "i16", "motion profile type")
ENCODER_INCREMENTS = Entry(0x608F, 1, "u32", "encoder increments")
ENCODER_REVOLUTIONS = Entry(0x608F, 2, "u32", "encoder motor revolutions")
GEAR_MOTOR = Entry(0x6091, 1, "u32", "motor revolutions of the gear")
GEAR_SHAFT = Entry(0x6091, 2, "u32", "shaft revolutions of the gear")
FEED = Entry(0x6092, 1, "u32", "feed")
FEED_SHAFT = Entry(0x6092, 2, "u32", "shaft revolutions of the feed")
POSITION_FACTOR = Entry(0x6093, 1, "u32", "position factor")
POSITION_DIVISOR = Entry(0x6093, 2, "u32", "divisor of the position factor")
VELOCITY_FACTOR = Entry(0x6096, 1, "u32", "velocity factor")
VELOCITY_DIVISOR = Entry(0x6096, 2, "u32", "divisor of the velocity factor")
ACCELERATION_FACTOR = Entry(0x6097, 1, "u32", "acceleration factor")
ACCELERATION_DIVISOR = Entry(0x6097, 2, "u32", "divisor of the acceleration factor")
HOMING_METHOD = Entry(0x6098, 0, "i8", "homing method")
HOMING_SPEED = Entry(0x6099, 1, "u32", "homing speed towards the switch")
HOMING_CREEP = Entry(0x6099, 2, "u32", "homing speed towards zero")
HOMING_ACCELERATION = Entry(0x609A, 0, "u32", "homing acceleration")
POSITION_UNIT = Entry(0x60A8, 0, "u32", "SI unit position")
VELOCITY_UNIT = Entry(0x60A9, 0, "u32", "SI unit velocity")
ACCELERATION_UNIT = Entry(0x60AA, 0, "u32", "SI unit acceleration")
VELOCITY_OFFSET = Entry(0x60B1, 0, "i32", "velocity offset")
TORQUE_OFFSET = Entry(0x60B2, 0, "i16", "torque offset")
INTERPOLATION_PERIOD = Entry(0x60C2, 1, "u8", "interpolation time period")
INTERPOLATION_POWER = Entry(0x60C2, 2, "i8", "interpolation time index")
MAX_ACCELERATION = Entry(0x60C5, 0, "u32", "max acceleration")
MAX_DECELERATION = Entry(0x60C6, 0, "u32", "max deceleration")
DIGITAL_INPUTS = Entry(0x60FD, 0, "u32", "digital inputs")
SUPPORTED_MODES = Entry(0x6502, 0, "u32", "supported drive modes")

# for information only
SHUTDOWN_OPTION = Entry(0x605B, 0, "i16", "shutdown option code")
DISABLE_OPTION = Entry(0x605C, 0, "i16", "disable operation option code")
FAULT_REACTION = Entry(0x605E, 0, "i16", "fault reaction option code")
TORQUE = Entry(0x6077, 0, "i16", "torque actual value")
CURRENT = Entry(0x6078, 0, "i16", "current actual value")
POLARITY = Entry(0x607E, 0, "u8", "polarity")
FOLLOWING_ERROR = Entry(0x60F4, 0, "i32", "following error actual value")

INTERPOLATION = (INTERPOLATION_PERIOD, INTERPOLATION_POWER)
"""Objects written for streaming."""
OFFSETS = (VELOCITY_OFFSET, TORQUE_OFFSET)
"""Objects sent with set-points for feed-forward."""
HOMING = (HOMING_METHOD, HOME_OFFSET, HOMING_SPEED, HOMING_CREEP, HOMING_ACCELERATION)
"""Objects written for homing."""


@dataclass(frozen=True, slots=True)
class VendorObject:
    """Manufacturer object, and the size of one count in SI units."""

    entry: Entry
    per_count: float

    def value(self, counts: int) -> float:
        """Convert counts to SI units."""
        return counts * self.per_count


@dataclass(frozen=True, slots=True)
class Maker:
    """Manufacturer objects of a maker's drives.

    Attributes
    ----------
    rated_current : VendorObject
        Rated current of the motor [A].
    torque_constant : VendorObject
        Torque constant of the motor [N m/A].
    brake_delay : VendorObject
        Closing time of the holding brake [s].
    """

    rated_current: VendorObject
    torque_constant: VendorObject
    brake_delay: VendorObject

    @property
    def entries(self) -> tuple[Entry, ...]:
        """Entries of all quantities."""
        quantities = (self.rated_current, self.torque_constant, self.brake_delay)
        return tuple(quantity.entry for quantity in quantities)


MAKERS = {
    0xFB: Maker(  # maxon, EPOS4 and IDX
        rated_current=VendorObject(Entry(0x3001, 1, "u32", "nominal current"), 1e-3),
        torque_constant=VendorObject(Entry(0x3001, 5, "u32", "torque constant"), 1e-6),
        brake_delay=VendorObject(Entry(0x3158, 2, "u16", "holding brake fall time"), 1e-3),
    )
}
"""Makers by vendor identifier."""

VELOCITY_FEED_FORWARDS = {
    0x4D2: Entry(0x2010, 0, "u16", "velocity feed-forward of the position loop")  # the plant's
}
"""Object with the velocity feed-forward gain of a drive, by vendor; gain 0 switches it off."""


def own_feed_forward(axis: AxisDrive) -> tuple[Entry, ...]:
    """Return the object of a drive's own feed-forward, if known: the master's would add to it."""
    own = VELOCITY_FEED_FORWARDS.get(axis.identity.vendor)
    return () if own is None else (own,)
