"""Table of requirements on a drive's object dictionary: a row for each object of the profile.

A row states the use of an object, the consequence of a missing one, the written value and other
acceptable values. Start-up, `hil drives check`, the scan and the review of data sheets use the
table, and the tables of `docs/reference/can.md` and `docs/reference/drives.md` are generated from
it. Rules on several objects, such as the range or the comparison of units, are code with texts from
this module. Communication and supervision belong to the bus, whose rows are inserted (`add_rows`).

A drive may round a written value to its resolution or clip it, without an error. That is acceptable
if the kept value protects as well: a lower speed, a smaller following error. Slower braking
lengthens a stop, and less torque lets a braking arm sink, so decelerations and torques may be
rounded but not clipped. Software limits may be further inside by any amount, and further outside by
one increment. A kept zero is never acceptable instead of another value: it often means "off".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, Flag, auto
from functools import partial
from typing import TYPE_CHECKING

from drivers.cia402 import objects as o
from drivers.commissioning.measures import Quantity

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping

    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import Entry


ROUNDING = 0.01
"""Largest relative rounding of a value."""


@dataclass(frozen=True, slots=True)
class Kept:
    """Rule for values that a drive may keep instead of the written one.

    Attributes
    ----------
    words : str
        The rule in words.
    accepts : callable
        ``accepts(written, kept, drives)``: True if the kept value is acceptable.
    """

    words: str
    accepts: Callable[[int, int, DrivesFile], bool]


def _accept_share(words: str, less: float, more: float) -> Kept:
    """Accept values above zero within a tolerance, as shares of the written value."""
    return Kept(
        words,
        lambda written, kept, _: kept > 0 and -less * written <= kept - written <= more * written,
    )


def _accept_inwards(direction: int) -> Kept:
    """Accept any change inwards (direction +1 or -1), and one increment outwards."""
    words = "any tighter limit, or a limit wider by one increment; any fixed range"
    return Kept(words, lambda written, kept, _: (kept - written) * direction >= -1)


EXACT = Kept("the value written", lambda written, kept, _: kept == written)
LESS = _accept_share(
    f"any smaller value above 0, or up to {100 * ROUNDING:g} % more", math.inf, ROUNDING
)
ROUNDED = _accept_share(f"{100 * ROUNDING:g} % less or more", ROUNDING, ROUNDING)
LOWER_END, UPPER_END = _accept_inwards(1), _accept_inwards(-1)


class Use(Flag):
    """Use of an object by the driver."""

    READ = auto()
    ASK = auto()
    """Read if possible: an object of a non-standard type is left out."""
    WRITE = auto()
    SET = READ | WRITE
    """Written, and read back."""
    VARY = auto()
    """Written repeatedly: an object fixed at any value is unsuitable."""
    SEND = auto()
    """The drive must be able to send the object in a PDO."""
    RECEIVE = auto()
    """The drive must be able to take the object from a PDO."""


class Lack(Enum):
    """Consequence of a missing object for the drive."""

    REFUSED = "refused"
    REFUSED_UNLESS_STATED = "refused unless `allow_no_heartbeat` states what else stops the axis"
    NOTED = "noted"
    SILENT = "not mentioned"


@dataclass(frozen=True, slots=True)
class Requirement:
    """Requirement on an object.

    Attributes
    ----------
    entry : Entry
        The object.
    use : Use
        Use by the driver.
    without : str
        Consequence of a missing object.
    lack : Lack
        Treatment of a drive without the object.
    value : int or None
        Written value, if common to all axes.
    serves : collection of int
        Other acceptable values, even if the object cannot be written.
    kept : Kept
        Rule for values kept after ours was written.
    quantity : Quantity or None
        Quantity of the object.
    own_holds : bool
        True for a limit of the axis: a tighter value of the drive is kept.
    instead : tuple of Entry
        Objects that replace a missing one, if all are present.
    served : str
        Consequence of a replacement or of an acceptable fixed value; empty if none.
    fixed : str
        Consequence of an unacceptable fixed value.
    """

    entry: Entry
    use: Use
    without: str
    lack: Lack
    value: int | None = None
    serves: Collection[int] = ()
    kept: Kept = EXACT
    quantity: Quantity | None = None
    own_holds: bool = False
    instead: tuple[Entry, ...] = ()
    served: str = ""
    fixed: str = ""


refused, noted, silent = (
    partial(Requirement, lack=lack) for lack in (Lack.REFUSED, Lack.NOTED, Lack.SILENT)
)


DRIVE_PROFILE = 402
"""Device profile (1000) of drives."""
STOPPING_OPTIONS = (1, 2, 3, 5, 6, 7)
"""Quick stop options with deceleration, other than coasting (0)."""
STAYS_ENERGISED = 5
"""Smallest quick stop option that ends in QUICK STOP ACTIVE."""
STATE_WHAT_STOPS = (
    "state allow_no_heartbeat with the reason in the drives file if something else stops the axis"
)
FAULT_REACTION, QUICK_STOP_REACTION = 1, 3


def reaction_for(quick_stop: int) -> int:
    """Return the required 6007 of a drive with quick stop option `quick_stop`.

    When this process dies, a quick stop with option 5 or higher would leave the axis powered.
    """
    return FAULT_REACTION if quick_stop >= STAYS_ENERGISED else QUICK_STOP_REACTION


def is_set(value: int, entry: Entry) -> bool:
    """Return True if a limit is set: neither 0 nor all bits set."""
    return value > 0 and value != (1 << 8 * entry.size) - 1


_limit = partial(
    Requirement,
    lack=Lack.NOTED,
    use=Use.SET,
    without="only the driver enforces this limit, not the drive",
    own_holds=True,
    fixed="the value must be tighter than the limit of the drives file",
)

_ANY = range(-(1 << 31), 1 << 32)
_SPEED, _ACCELERATION = Quantity.SPEED, Quantity.ACCELERATION
_STATED = "drive refused if stated in the drives file"
_NO_RANGE = "the drive itself would not enforce the axis's range"
_OWN_RANGE = "where the drive does not enforce the axis's range, the driver does"
_UNWATCHED = "the drive's own supervision of the following error is used; check its setting"
_OWN_WINDOW = "target reached depends on the drive's own window"
_COASTS = "the axis may coast"
_COUNTS = "increments_per_revolution is not verified"
_OTHERS = "computed from the other scaling objects"
_VELOCITY, _RATE = "velocity_unit is not verified", "acceleration_unit is not verified"
_TURNS = "positions are assumed not to wrap around"

_NEEDED = (
    refused(o.DEVICE_TYPE, Use.READ, "the drive does not state that it follows CiA 402"),
    silent(o.VENDOR, Use.READ, _STATED),
    silent(o.PRODUCT, Use.READ, _STATED),
    silent(o.REVISION, Use.READ, _STATED),
    silent(o.SERIAL, Use.READ, _STATED),
    # state, mode and motion
    refused(o.STATUSWORD, Use.READ | Use.SEND, "the drive's state cannot be followed"),
    refused(o.CONTROLWORD, Use.WRITE | Use.RECEIVE, "the drive cannot be commanded"),
    refused(o.MODE, Use.WRITE | Use.VARY, "profile position mode cannot be chosen"),
    refused(o.MODE_DISPLAY, Use.READ, "the mode cannot be verified"),
    noted(o.SUPPORTED_MODES, Use.READ, "modes are verified only when commanded"),
    refused(o.POSITION, Use.READ | Use.SEND, "positions cannot be measured"),
    refused(o.TARGET_POSITION, Use.WRITE | Use.RECEIVE, "no target can be commanded"),
    refused(
        o.PROFILE_VELOCITY, Use.SET | Use.VARY, "the speed of a motion cannot be set",
        kept=LESS, quantity=_SPEED,
    ),
    refused(
        o.PROFILE_ACCELERATION, Use.SET | Use.VARY, "the acceleration of a motion cannot be set",
        kept=LESS, quantity=_ACCELERATION,
    ),
    noted(
        o.PROFILE_DECELERATION, Use.SET | Use.VARY,
        "profile acceleration (6083) must apply to deceleration too",
        kept=ROUNDED, quantity=_ACCELERATION, fixed="the deceleration of a motion cannot be set",
    ),
    noted(
        o.PROFILE_TYPE, Use.SET, "trapezoidal profiles are assumed",
        value=0, fixed="profiles are not trapezoidal",
    ),
    # limits kept by the drive
    refused(
        o.SOFTWARE_LIMIT_MIN, Use.SET, _NO_RANGE,
        serves=_ANY, kept=LOWER_END, quantity=Quantity.POSITION, served=_OWN_RANGE,
    ),
    refused(
        o.SOFTWARE_LIMIT_MAX, Use.SET, _NO_RANGE,
        serves=_ANY, kept=UPPER_END, quantity=Quantity.POSITION, served=_OWN_RANGE,
    ),
    _limit(o.MAX_PROFILE_VELOCITY, kept=LESS, quantity=_SPEED, instead=(o.MAX_MOTOR_SPEED,)),
    _limit(
        o.MAX_MOTOR_SPEED,
        kept=LESS, quantity=Quantity.MOTOR_SPEED, instead=(o.MAX_PROFILE_VELOCITY,),
    ),
    _limit(o.MAX_ACCELERATION, kept=LESS, quantity=_ACCELERATION),
    _limit(o.MAX_DECELERATION, kept=ROUNDED, quantity=_ACCELERATION),
    _limit(
        o.QUICK_STOP_DECELERATION, kept=ROUNDED, quantity=_ACCELERATION,
        without="the drive's own ramp of a quick stop is used; check its setting",
    ),
    _limit(o.MAX_TORQUE, kept=ROUNDED, quantity=Quantity.TORQUE, instead=(o.MAX_CURRENT,)),
    _limit(
        o.MAX_CURRENT, kept=ROUNDED, quantity=Quantity.CURRENT,
        lack=Lack.SILENT, without="6072 is the only limit of torque",
    ),
    noted(
        o.FOLLOWING_ERROR_WINDOW, Use.SET, _UNWATCHED, kept=LESS, quantity=Quantity.DISTANCE,
        fixed="the value must equal the window of the drives file",
    ),
    noted(o.FOLLOWING_ERROR_TIME, Use.SET, _UNWATCHED, serves=_ANY),
    noted(o.POSITION_WINDOW, Use.SET, _OWN_WINDOW, serves=_ANY),
    noted(o.POSITION_WINDOW_TIME, Use.SET, _OWN_WINDOW, serves=_ANY),
    # reactions
    noted(
        o.QUICK_STOP_OPTION, Use.SET, "the drive's own quick stop is used; check its setting",
        serves=STOPPING_OPTIONS, fixed=_COASTS,
    ),
    noted(
        o.HALT_OPTION, Use.SET, "the drive's own halt is used; check its setting",
        value=1, serves=(2, 3, 4), fixed=_COASTS,
    ),
    noted(
        o.ABORT_CONNECTION_OPTION, Use.SET,
        "the drive's own reaction to a lost heartbeat is used; check it before the first run",
        value=QUICK_STOP_REACTION, serves=(1, 2, 3),
        fixed="the axis may keep moving after a crash of this program",
    ),
)  # fmt: skip

_STATEMENTS = (
    # faults
    noted(
        o.ERROR_CODE, Use.ASK, "a fault's cause is known only from its emergency message",
        instead=(o.ERROR_HISTORY,),
    ),
    silent(o.ERROR_HISTORY, Use.ASK, "a fault's cause is read from 603F"),
    silent(o.DIGITAL_INPUTS, Use.ASK, "safe torque off is visible only in 603F"),
    # ratings and units
    noted(o.RATED_CURRENT, Use.READ, "rated_current is not verified"),
    noted(o.RATED_TORQUE, Use.READ, "rated_torque is not verified"),
    noted(o.ENCODER_INCREMENTS, Use.ASK, _COUNTS, instead=(o.FEED,)),
    silent(o.ENCODER_REVOLUTIONS, Use.ASK, _OTHERS),
    silent(o.GEAR_MOTOR, Use.ASK, _OTHERS),
    silent(o.GEAR_SHAFT, Use.ASK, _OTHERS),
    silent(o.FEED, Use.ASK, _OTHERS),
    silent(o.FEED_SHAFT, Use.ASK, _OTHERS),
    silent(o.POSITION_FACTOR, Use.ASK, _OTHERS),
    silent(o.POSITION_DIVISOR, Use.ASK, _OTHERS),
    silent(o.POSITION_UNIT, Use.ASK, _OTHERS),
    silent(o.VELOCITY_UNIT, Use.ASK, _VELOCITY),
    silent(o.VELOCITY_FACTOR, Use.ASK, _VELOCITY),
    silent(o.VELOCITY_DIVISOR, Use.ASK, _VELOCITY),
    silent(o.ACCELERATION_UNIT, Use.ASK, _RATE),
    silent(o.ACCELERATION_FACTOR, Use.ASK, _RATE),
    silent(o.ACCELERATION_DIVISOR, Use.ASK, _RATE),
    silent(o.HOME_OFFSET, Use.ASK, "positions are assumed not to be shifted"),
    silent(o.POSITION_RANGE_MIN, Use.ASK, _TURNS),
    silent(o.POSITION_RANGE_MAX, Use.ASK, _TURNS),
)  # fmt: skip


def add_rows(rows: Iterable[Requirement] = ()) -> Mapping[Entry, Requirement]:
    """Return the table with the rows of a bus, in the order of reading."""
    return {row.entry: row for row in (*_NEEDED, *rows, *_STATEMENTS)}


REQUIREMENTS = add_rows()
"""Requirements of the profile alone, by object."""

OF_PROFILES = frozenset(
    {o.PROFILE_VELOCITY, o.PROFILE_ACCELERATION, o.PROFILE_DECELERATION, o.PROFILE_TYPE}
)
"""Objects needed in profile position mode only, by drives that plan their own motion."""

OWN_LIMITS = tuple(row for row in _NEEDED if row.own_holds)
"""Limits of an axis in the drive, other than its range."""
