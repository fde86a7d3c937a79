"""What a drive may keep instead of a value that was written: a table, object by object.

A drive may round to its own resolution or clip to a bound of its own, and say nothing of it. That
is no reason to refuse the drive where what it keeps protects as well: a lower speed, a smaller
following error. `ALLOWANCES` states for each object how much less and how much more than written
will do, as shares of the value written; an object that is not in the table must read back exactly.

Slower braking makes the way of a stop longer, and less torque makes a brake of an arm that sinks,
so decelerations and torques may be rounded but not clipped. Software limits may lie further inside
by any amount, and further outside by one increment. Time-outs of heartbeats follow from the drives
file: a drive may send its own less often as long as two fit into `heartbeat_timeout`, and may wait
for ours a little longer than that, but neither without end nor for less than two beats.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import TYPE_CHECKING, NamedTuple

from drivers.axis import AxisScale
from drivers.canopen import objects as cia301
from drivers.cia402 import objects

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry

ROUNDING = 0.01
"""Share of a value by which a drive may round it."""

LONGER_WATCH = 1.5
"""Times `heartbeat_timeout` that a drive may wait for our heartbeat at most."""

ANY = math.inf


class Quantity(Enum):
    """What an object counts, for messages in SI."""

    SPEED = auto()
    MOTOR_SPEED = auto()
    ACCELERATION = auto()
    ANGLE = auto()
    TORQUE = auto()


class Allowance(NamedTuple):
    """How far from the value written what a drive keeps may be.

    Attributes
    ----------
    less, more : float
        As shares of the value written; ANY for as far as there is a value above zero.
    quantity : Quantity, optional
        What is counted.
    """

    less: float
    more: float
    quantity: Quantity | None = None


ALLOWANCES: Mapping[Entry, Allowance] = {
    cia301.CYCLE_PERIOD: Allowance(ROUNDING, ROUNDING),
    objects.FOLLOWING_ERROR_WINDOW: Allowance(ANY, ROUNDING, Quantity.ANGLE),
    objects.MAX_TORQUE: Allowance(ROUNDING, ROUNDING, Quantity.TORQUE),
    objects.MAX_CURRENT: Allowance(ROUNDING, ROUNDING),
    objects.MAX_PROFILE_VELOCITY: Allowance(ANY, ROUNDING, Quantity.SPEED),
    objects.MAX_MOTOR_SPEED: Allowance(ANY, ROUNDING, Quantity.MOTOR_SPEED),
    objects.PROFILE_VELOCITY: Allowance(ANY, ROUNDING, Quantity.SPEED),
    objects.PROFILE_ACCELERATION: Allowance(ANY, ROUNDING, Quantity.ACCELERATION),
    objects.PROFILE_DECELERATION: Allowance(ROUNDING, ROUNDING, Quantity.ACCELERATION),
    objects.QUICK_STOP_DECELERATION: Allowance(ROUNDING, ROUNDING, Quantity.ACCELERATION),
    objects.MAX_ACCELERATION: Allowance(ANY, ROUNDING, Quantity.ACCELERATION),
    objects.MAX_DECELERATION: Allowance(ROUNDING, ROUNDING, Quantity.ACCELERATION),
}
"""By object; zero is never accepted in the place of another value, since it often means "off"."""

INWARDS: Mapping[Entry, int] = {objects.SOFTWARE_LIMIT_MIN: 1, objects.SOFTWARE_LIMIT_MAX: -1}
"""In which direction a limit of the position lies further inside the range."""


class Readback:
    """Judges what the drive of one axis keeps, and shows it in SI.

    Parameters
    ----------
    axis, drives : AxisDrive, DrivesFile
        What the drives file states.
    """

    def __init__(self, axis: AxisDrive, drives: DrivesFile) -> None:
        scale = AxisScale.of(axis)
        unit, force = axis.unit, axis.effort_unit
        self._scale, self._unit = scale, unit
        self._units = {
            Quantity.SPEED: (scale.velocity, f"{unit}/s"),
            Quantity.ACCELERATION: (scale.acceleration, f"{unit}/s^2"),
            Quantity.ANGLE: (abs(scale.position), unit),
            Quantity.TORQUE: (scale.torque_limit, force),
            Quantity.MOTOR_SPEED: (2 * math.pi / 60 / axis.gear_ratio, f"{unit}/s"),
        }
        self._period = 1000 * drives.heartbeat_period
        self._timeout = 1000 * drives.heartbeat_timeout

    def accepts(self, entry: Entry, written: int, kept: int) -> bool:
        """Whether a drive serves that keeps `kept` after `written` was written to an object."""
        if entry in INWARDS:
            return (kept - written) * INWARDS[entry] >= -1
        if entry == cia301.PRODUCER_HEARTBEAT:
            return 0 < kept <= self._timeout / 2
        if entry.index == cia301.CONSUMER_HEARTBEAT.index:
            watched, time = kept >> 16, kept & 0xFFFF
            longest = LONGER_WATCH * self._timeout
            return watched == written >> 16 and 2 * self._period <= time <= longest
        allowed = ALLOWANCES.get(entry)
        if allowed is None or kept <= 0:
            return False
        return -allowed.less * written <= kept - written <= allowed.more * written

    def compared(self, entry: Entry, written: int, kept: int) -> str:
        """Return what is kept and what was written in SI, for limits."""
        shown = self._in_si(entry)
        return "" if shown is None else f" ({shown(kept)} instead of {shown(written)})"

    def _in_si(self, entry: Entry) -> Callable[[int], str] | None:
        if entry in INWARDS:
            scale = self._scale
            return lambda end: f"{scale.position_from_counts(float(end)):.5g} {self._unit}"
        allowed = ALLOWANCES.get(entry)
        if allowed is None or allowed.quantity is None:
            return None
        per_count, unit = self._units[allowed.quantity]
        return lambda counts: f"{counts * per_count:.5g} {unit}"
