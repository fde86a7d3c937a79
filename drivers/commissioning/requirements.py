"""What measuring needs of a drive's object dictionary, as a table.

One line an object: what we do with it, and what follows where a drive lacks it. Those that are
required are what `drivers.commissioning.configure` refuses a drive for; the others it can do
without.
"""

from __future__ import annotations

from enum import Flag, auto
from typing import TYPE_CHECKING, NamedTuple

from drivers.canopen import objects as cia301
from drivers.cia402 import objects

if TYPE_CHECKING:
    from drivers.fieldbus import Entry


class Use(Flag):
    """What we do with an object."""

    READ = auto()
    WRITE = auto()
    SEND = auto()
    """The drive must be able to send it in a PDO."""
    RECEIVE = auto()
    """The drive must be able to take it from a PDO."""


class Need(NamedTuple):
    """One object that we use.

    Attributes
    ----------
    entry : Entry
        Which.
    use : Use
        What we do with it.
    without : str
        What follows where it is missing.
    required : bool
        A drive without it is refused.
    value : int, optional
        What we write, where that is always the same.
    fixed : str
        What follows where it cannot be written, if the drive serves all the same.
    instead : tuple of Entry
        What does in its place, if all of it is there.
    served : str
        What follows then.
    """

    entry: Entry
    use: Use
    without: str
    required: bool
    value: int | None = None
    fixed: str = ""
    instead: tuple[Entry, ...] = ()
    served: str = ""


GUARDING = (cia301.GUARD_TIME, cia301.LIFE_TIME_FACTOR)
_GUARDED = "it watches our guarding requests (100C, 100D) instead and answers them"


def _required(entry: Entry, use: Use, without: str) -> Need:
    return Need(entry, use, without, required=True)


def _optional(entry: Entry, use: Use, without: str, value: int | None = None) -> Need:
    return Need(entry, use, without, required=False, value=value)


READ, WRITE = Use.READ, Use.WRITE
NO_RANGE = "the drive itself would not keep the axis's range"
FIXED_RANGE = "it keeps its own range; what of the axis's range it does not keep, our driver does"
OURS_ALONE = "this limit is kept by our driver alone, not by the drive"

NEEDS = (
    _required(cia301.DEVICE_TYPE, READ, "it does not say that it is a CiA 402 drive"),
    _required(objects.STATUSWORD, READ | Use.SEND, "its state cannot be followed"),
    _required(objects.CONTROLWORD, WRITE | Use.RECEIVE, "it cannot be commanded"),
    _required(objects.MODE, WRITE, "profile position mode cannot be chosen"),
    _required(objects.MODE_DISPLAY, READ, "the mode cannot be verified"),
    _required(objects.POSITION, READ | Use.SEND, "positions cannot be measured"),
    _required(objects.TARGET_POSITION, WRITE | Use.RECEIVE, "it cannot be told where to go"),
    _required(objects.PROFILE_VELOCITY, WRITE, "the speed of a motion cannot be set"),
    _required(objects.PROFILE_ACCELERATION, WRITE, "the acceleration of a motion cannot be set"),
    Need(objects.SOFTWARE_LIMIT_MIN, WRITE, NO_RANGE, required=True, fixed=FIXED_RANGE),
    Need(objects.SOFTWARE_LIMIT_MAX, WRITE, NO_RANGE, required=True, fixed=FIXED_RANGE),
    Need(
        cia301.CONSUMER_HEARTBEAT,
        READ | WRITE,
        "the axis goes on when our process dies; something else must stop it",
        required=False,
        instead=GUARDING,
        served=_GUARDED,
    ),
    Need(
        cia301.PRODUCER_HEARTBEAT,
        WRITE,
        "we would not notice that the drive is gone",
        required=True,
        instead=GUARDING,
        served=_GUARDED,
    ),
    _optional(
        objects.SUPPORTED_MODES, READ, "whether it has profile position mode shows when it is asked"
    ),
    _optional(
        objects.ABORT_CONNECTION_OPTION,
        READ | WRITE,
        "what it does when our heartbeat is lost is the maker's: look it up before the first run",
        3,
    ),
    _optional(objects.QUICK_STOP_OPTION, READ | WRITE, "its own quick stop is used: look it up"),
    _optional(objects.HALT_OPTION, READ | WRITE, "its own halt is used", 1),
    _optional(objects.QUICK_STOP_DECELERATION, READ | WRITE, "its own ramp of quick stop is used"),
    _optional(
        objects.PROFILE_DECELERATION,
        READ | WRITE,
        "its profile acceleration (6083) must hold for decelerating too",
    ),
    _optional(objects.MAX_TORQUE, READ | WRITE, OURS_ALONE),
    _optional(objects.MAX_PROFILE_VELOCITY, READ | WRITE, OURS_ALONE),
    _optional(objects.MAX_MOTOR_SPEED, READ | WRITE, OURS_ALONE),
    _optional(
        objects.FOLLOWING_ERROR_WINDOW,
        READ | WRITE,
        "its own supervision of the following error is used: look it up",
    ),
    _optional(
        objects.FOLLOWING_ERROR_TIME,
        READ | WRITE,
        "its own supervision of the following error is used: look it up",
    ),
    _optional(objects.POSITION_WINDOW, READ | WRITE, "its own window decides on target reached"),
    _optional(
        objects.POSITION_WINDOW_TIME, READ | WRITE, "its own window decides on target reached"
    ),
    _optional(
        objects.PROFILE_TYPE, READ | WRITE, "that profiles are trapezoids is taken on trust", 0
    ),
    _optional(cia301.CYCLE_PERIOD, READ | WRITE, "it does not know the period of SYNC"),
    _optional(
        objects.RATED_CURRENT, READ, "rated_current of the drives file cannot be compared with it"
    ),
    _optional(
        objects.RATED_TORQUE, READ, "rated_torque of the drives file cannot be compared with it"
    ),
    _optional(
        objects.ENCODER_INCREMENTS,
        READ,
        "increments_per_revolution of the drives file cannot be compared with it",
    ),
    _optional(
        objects.ERROR_CODE, READ, "a fault's cause is known from its emergency message alone"
    ),
)
"""What we use, the required first."""

IDENTITY = (cia301.VENDOR, cia301.PRODUCT, cia301.REVISION, cia301.SERIAL)

UNITS = (objects.POSITION_UNIT, objects.VELOCITY_UNIT, objects.ACCELERATION_UNIT)
"""In what positions, velocities and accelerations are, where a drive says so."""

DRIVE_TRAIN = (
    objects.ENCODER_REVOLUTIONS,
    objects.GEAR_MOTOR,
    objects.GEAR_SHAFT,
    objects.FEED,
    objects.FEED_SHAFT,
    objects.POSITION_FACTOR,
    objects.POSITION_DIVISOR,
)
"""What else decides on the unit of positions (`drivers.commissioning.position_units`)."""
