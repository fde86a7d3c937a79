"""What a run needs of a drive's object dictionary: one table, a row an object.

A row states what is done with an object, what becomes of a drive that lacks it and what follows
from that, what is written to it and what may stand there instead. Start-up, `hil check`, the scan
and the review of data sheets act on it, and the tables of `docs/reference/can.md` and
`docs/reference/drives.md` are made from it. What depends on more than one object is code, which
takes its sentences from here: the sequence for SYNC and PDOs, the range, who watches whom, the
comparison of units.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.communication import SYNC
from drivers.canopen.pdo_mapping import AT_SYNC, ON_SYNC
from drivers.cia402 import objects as o
from drivers.commissioning.kept_values import (
    BEATS,
    LESS,
    LIFE_TIME,
    LOWER_END,
    ROUNDED,
    UPPER_END,
    WATCHES,
)
from drivers.commissioning.measures import Quantity
from drivers.commissioning.requirement import Lack, Requirement, Use

if TYPE_CHECKING:
    from drivers.fieldbus import Entry

DRIVE_PROFILE = 402
"""Device profile (1000) of drives."""
STOPPING_OPTIONS = (1, 2, 3, 5, 6, 7)
"""Quick stop options that slow down, instead of letting the axis coast (0)."""
STAYS_ENERGISED = 5
"""Quick stop options from here on end in QUICK STOP ACTIVE."""
STATE_WHAT_STOPS = (
    "state allow_no_heartbeat with the reason in the drives file if something else stops it"
)
FAULT_REACTION, QUICK_STOP_REACTION = 1, 3


def reaction_for(quick_stop: int) -> int:
    """Return what 6007 must be for a drive whose quick stop option is `quick_stop`.

    A quick stop alone would leave an axis powered, when our process dies, that it does not switch
    off.
    """
    return FAULT_REACTION if quick_stop >= STAYS_ENERGISED else QUICK_STOP_REACTION


def is_set(value: int, entry: Entry) -> bool:
    """Whether a limit is one: 0 and all ones are none."""
    return value > 0 and value != (1 << 8 * entry.size) - 1


_refused = partial(Requirement, lack=Lack.REFUSED)
_noted = partial(Requirement, lack=Lack.NOTED)
_silent = partial(Requirement, lack=Lack.SILENT)
_limit = partial(
    Requirement,
    lack=Lack.NOTED,
    use=Use.SET,
    without="this limit is kept by the driver alone",
    own_holds=True,
    fixed="it serves only with a limit of its own that is tighter than the drives file's",
)

_ANY = range(-(1 << 31), 1 << 32)
_SPEED, _ACCELERATION = Quantity.SPEED, Quantity.ACCELERATION
_GUARDING = (cia301.GUARD_TIME, cia301.LIFE_TIME_FACTOR)
_GUARDED = "it watches our guarding requests (100C, 100D) instead and answers them"
_HEARTBEATS = "heartbeats alone (1016, 1017) watch"
_STATED = "a drive for which the drives file states it is refused"
_NO_RANGE = "the drive itself would not keep the axis's range"
_OWN_RANGE = "what of the axis's range it does not keep, the driver alone does"
_UNWATCHED = "the drive's own supervision of the following error is used; look it up"
_OWN_WINDOW = "the drive's own window decides on target reached"
_COASTS = "it may let the axis coast"
_COUNTS = "increments_per_revolution is taken on trust"
_OTHERS = "what the others of its kind lead to counts"
_VELOCITY, _RATE = "velocity_unit is taken on trust", "acceleration_unit is taken on trust"
ON_ARRIVAL = (
    "set-points of a stream act when they arrive, so the jitter of this computer reaches its loops"
)
_TURNS = "positions are taken not to wrap around"

_ROWS = (
    _refused(cia301.DEVICE_TYPE, Use.READ, "it does not say that it is a CiA 402 drive"),
    _silent(cia301.VENDOR, Use.READ, _STATED),
    _silent(cia301.PRODUCT, Use.READ, _STATED),
    _silent(cia301.REVISION, Use.READ, _STATED),
    _silent(cia301.SERIAL, Use.READ, _STATED),
    # State, mode and motion
    _refused(o.STATUSWORD, Use.READ | Use.SEND, "its state cannot be followed"),
    _refused(o.CONTROLWORD, Use.WRITE | Use.RECEIVE, "it cannot be commanded"),
    _refused(o.MODE, Use.WRITE | Use.VARY, "profile position mode cannot be chosen"),
    _refused(o.MODE_DISPLAY, Use.READ, "the mode cannot be verified"),
    _noted(o.SUPPORTED_MODES, Use.READ, "its mode shows when it is asked for"),
    _refused(o.POSITION, Use.READ | Use.SEND, "positions cannot be measured"),
    _refused(o.TARGET_POSITION, Use.WRITE | Use.RECEIVE, "no target can be commanded"),
    _refused(
        o.PROFILE_VELOCITY, Use.SET | Use.VARY, "the speed of a motion cannot be set",
        kept=LESS, quantity=_SPEED,
    ),
    _refused(
        o.PROFILE_ACCELERATION, Use.SET | Use.VARY, "the acceleration of a motion cannot be set",
        kept=LESS, quantity=_ACCELERATION,
    ),
    _noted(
        o.PROFILE_DECELERATION, Use.SET | Use.VARY,
        "its profile acceleration (6083) must hold for decelerating too",
        kept=ROUNDED, quantity=_ACCELERATION, fixed="the deceleration of a motion cannot be set",
    ),
    _noted(
        o.PROFILE_TYPE, Use.SET, "that profiles are trapezoids is taken on trust",
        value=0, fixed="its profiles are no trapezoids",
    ),
    # Limits that the drive keeps
    _refused(
        o.SOFTWARE_LIMIT_MIN, Use.SET, _NO_RANGE,
        serves=_ANY, kept=LOWER_END, quantity=Quantity.POSITION, served=_OWN_RANGE,
    ),
    _refused(
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
        without="the drive's own ramp of a quick stop is used; look it up",
    ),
    _limit(o.MAX_TORQUE, kept=ROUNDED, quantity=Quantity.TORQUE, instead=(o.MAX_CURRENT,)),
    _limit(
        o.MAX_CURRENT, kept=ROUNDED, quantity=Quantity.CURRENT,
        lack=Lack.SILENT, without="6072 is the only limit of torque",
    ),
    _noted(
        o.FOLLOWING_ERROR_WINDOW, Use.SET, _UNWATCHED, kept=LESS, quantity=Quantity.DISTANCE,
        fixed="it serves only with the window of the drives file",
    ),
    _noted(o.FOLLOWING_ERROR_TIME, Use.SET, _UNWATCHED, serves=_ANY),
    _noted(o.POSITION_WINDOW, Use.SET, _OWN_WINDOW, serves=_ANY),
    _noted(o.POSITION_WINDOW_TIME, Use.SET, _OWN_WINDOW, serves=_ANY),
    # Reactions
    _noted(
        o.QUICK_STOP_OPTION, Use.SET, "the drive's own quick stop is used; look it up",
        serves=STOPPING_OPTIONS, fixed=_COASTS,
    ),
    _noted(
        o.HALT_OPTION, Use.SET, "the drive's own halt is used; look it up",
        value=1, serves=(2, 3, 4), fixed=_COASTS,
    ),
    _noted(
        o.ABORT_CONNECTION_OPTION, Use.SET,
        "its own reaction counts when our heartbeat is lost; look it up before the first run",
        value=QUICK_STOP_REACTION, serves=(1, 2, 3),
        fixed="the axis may go on when our process dies",
    ),
    # Who watches whom
    Requirement(
        cia301.CONSUMER_HEARTBEAT, Use.SET, "the axis goes on when our process dies",
        Lack.REFUSED_UNLESS_STATED, kept=WATCHES, instead=_GUARDING, served=_GUARDED,
    ),
    _refused(
        cia301.PRODUCER_HEARTBEAT, Use.SET, "nobody would notice that the drive is gone",
        kept=BEATS, instead=_GUARDING, served=_GUARDED,
    ),
    _silent(cia301.GUARD_TIME, Use.SET, _HEARTBEATS, kept=LIFE_TIME),
    _silent(cia301.LIFE_TIME_FACTOR, Use.SET, _HEARTBEATS, kept=LIFE_TIME),
    # SYNC, emergencies, faults
    _silent(
        cia301.SYNC_COB_ID, Use.SET, "that it listens to SYNC under 80h is taken on trust",
        value=SYNC, serves=(SYNC | 1 << 31,), fixed="it produces SYNC, or does not listen to ours",
    ),
    _silent(
        cia301.SYNC_COUNTER, Use.SET, "it expects no counter in SYNC",
        value=0, fixed="it does not act on our SYNC, which has no counter",
    ),
    _noted(
        cia301.CYCLE_PERIOD, Use.SET, "it does not know the period of SYNC",
        kept=ROUNDED, fixed="it serves only with the period of SYNC",
    ),
    _noted(
        cia301.SET_POINT_TRANSMISSION, Use.SET, ON_ARRIVAL,
        value=ON_SYNC, serves=range(256), served=f"above {AT_SYNC[-1]}, {ON_ARRIVAL}",
    ),
    _silent(cia301.EMERGENCY_COB_ID, Use.READ, "emergencies are expected under 80h plus node"),
    _noted(
        o.ERROR_CODE, Use.ASK, "a fault's cause is known from its emergency message alone",
        instead=(o.ERROR_HISTORY,),
    ),
    _silent(o.ERROR_HISTORY, Use.ASK, "a fault's cause is read from 603F"),
    _silent(o.DIGITAL_INPUTS, Use.ASK, "safe torque off shows in 603F alone"),
    # Ratings and units
    _noted(o.RATED_CURRENT, Use.READ, "rated_current is taken on trust"),
    _noted(o.RATED_TORQUE, Use.READ, "rated_torque is taken on trust"),
    _noted(o.ENCODER_INCREMENTS, Use.ASK, _COUNTS, instead=(o.FEED,)),
    _silent(o.ENCODER_REVOLUTIONS, Use.ASK, _OTHERS),
    _silent(o.GEAR_MOTOR, Use.ASK, _OTHERS),
    _silent(o.GEAR_SHAFT, Use.ASK, _OTHERS),
    _silent(o.FEED, Use.ASK, _OTHERS),
    _silent(o.FEED_SHAFT, Use.ASK, _OTHERS),
    _silent(o.POSITION_FACTOR, Use.ASK, _OTHERS),
    _silent(o.POSITION_DIVISOR, Use.ASK, _OTHERS),
    _silent(o.POSITION_UNIT, Use.ASK, _OTHERS),
    _silent(o.VELOCITY_UNIT, Use.ASK, _VELOCITY),
    _silent(o.VELOCITY_FACTOR, Use.ASK, _VELOCITY),
    _silent(o.VELOCITY_DIVISOR, Use.ASK, _VELOCITY),
    _silent(o.ACCELERATION_UNIT, Use.ASK, _RATE),
    _silent(o.ACCELERATION_FACTOR, Use.ASK, _RATE),
    _silent(o.ACCELERATION_DIVISOR, Use.ASK, _RATE),
    _silent(o.HOME_OFFSET, Use.ASK, "positions are taken not to be shifted"),
    _silent(o.POSITION_RANGE_MIN, Use.ASK, _TURNS),
    _silent(o.POSITION_RANGE_MAX, Use.ASK, _TURNS),
)  # fmt: skip

REQUIREMENTS = {row.entry: row for row in _ROWS}
"""The rows by object, in the order in which a drive is asked for them."""

OF_PROFILES = frozenset(
    {o.PROFILE_VELOCITY, o.PROFILE_ACCELERATION, o.PROFILE_DECELERATION, o.PROFILE_TYPE}
)
"""What a drive needs that plans its ways by itself, in profile position mode."""

OWN_LIMITS = tuple(row for row in _ROWS if row.own_holds)
"""What limits an axis in the drive itself, beside its range."""
