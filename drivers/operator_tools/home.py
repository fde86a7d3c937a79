"""Motion of a single axis: `hil drives home` and `hil drives jog`.

The drive does the homing in its own mode (6): method (6098), speeds (6099), acceleration (609A),
and the position of the home position (607C). It is commanded by bit 4 of the controlword and
answers in the statusword: bit 12 homing attained, bit 13 homing error, bit 10 at rest. Its path is
known only to the drive, so the only safeguards are a stop key and a time limit. A jog is a slow
relative motion: distance and velocity are checked against the limits before anything is powered on,
the operator consents to the actual numbers, and the move is supervised as in a check. The other
axes stay unpowered, held by their brakes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.axis import Axis, AxisScale
from drivers.cia402 import objects
from drivers.cia402.set_point import ENABLED
from drivers.cia402.set_point_limits import check_move
from drivers.cia402.states import MODE_TIME, Control, Mode, Status
from drivers.commissioning.effective_limits import effective_limits
from drivers.drive_bus import DriveRefused, LimitExceeded, MoveFailed
from drivers.found_settings.keeping import SettingsKeeper
from drivers.operator_tools.operator import pressed, require_consent
from drivers.operator_tools.small_move import format_coordinate, small_move, travel
from drivers.session.servo_axes import ServoAxes

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drives_file import AxisDrive, DrivesFile, Homing
    from drivers.operator_tools.operator import Operator
    from drivers.operator_tools.small_move import Stroke
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Fieldbus

SLOW = 0.2
"""Largest velocity of a jog, as a share of the velocity limit."""


def jog(
    bus: Fieldbus,
    drives: DrivesFile,
    axis: AxisDrive,
    way: float,
    velocity: float,
    operator: Operator,
    keeper: SettingsKeeper | None = None,
) -> Stroke:
    """Move an axis and return the observed stroke; the axis is off afterwards.

    Parameters
    ----------
    bus : Fieldbus
        An open bus.
    drives : DrivesFile
    axis : AxisDrive
        Axis to move.
    way, velocity : float
        Signed distance [rad or m], and velocity, at most `SLOW` of the limit [rad/s or m/s].
    operator : Operator
        Consents to the motion and can stop it.
    keeper : SettingsKeeper, optional
        See `drivers.session.servo_axes.ServoAxes`.

    Raises
    ------
    LimitExceeded
        Too far or too fast; nothing was powered on.
    StoppedByOperator, DriveError
        The axis is stopped and off.
    """
    alone = drives.model_copy(update={"axes": (axis,)})
    (server,) = bus.unpowered(alone).servers
    limits = effective_limits(server.find, axis, server.label)
    held = limits.apply_to(axis)
    named = Axis(drives.axes.index(axis), axis, held, server, limits.own, wrap=limits.wrap)
    fastest = SLOW * held.limits.velocity
    if velocity > fastest:
        raise LimitExceeded(
            f"{axis.name}: {format_coordinate(axis, velocity)}/s must be at most"
            f" {format_coordinate(axis, fastest)}/s, {SLOW:.0%} of its limit; jog more slowly"
        )
    position = server.get(objects.POSITION)
    place = named.wrap.unwrap(position) if named.wrap else position
    start = named.scale.position_from_counts(float(place))
    move = small_move(held, start + way, velocity)
    check_move(move, named)
    intent = (
        f"Power on {axis.name} alone and move it from {format_coordinate(axis, start)} to "
        f"{format_coordinate(axis, move.target)} at {format_coordinate(axis, move.velocity)}/s?"
    )
    require_consent(operator, intent)
    with ServoAxes(bus, alone, keeper=keeper) as axes:
        return travel(axes, 0, held, move, operator)


POLLED = 0.05
"""Time before each poll of the drive [s]; an immediate first poll may read a stale state."""

_START = ENABLED | Control.NEW_SET_POINT
_ATTAINED, _ERROR = Status.SET_POINT_ACKNOWLEDGE, Status.FOLLOWING_ERROR


def home(
    bus: Fieldbus,
    drives: DrivesFile,
    axis: AxisDrive,
    homing: Homing,
    operator: Operator,
    *,
    patience: float,
    keeper: SettingsKeeper | None = None,
) -> float:
    """Home an axis and return its position [rad or m]; the axis is off afterwards.

    Parameters
    ----------
    bus, drives, axis, operator, keeper
        See `jog`.
    homing : Homing
        Homing parameters.
    patience : float
        Longest duration [s].

    Raises
    ------
    DriveRefused
        The drive has no homing mode or not this method.
    LimitExceeded
        Too fast; nothing was powered on.
    MoveFailed
        The drive found no reference.
    StoppedByOperator, DriveError
        The axis is stopped and off.
    """
    alone = drives.model_copy(update={"axes": (axis,)})
    (server,) = bus.unpowered(alone).servers
    limits = effective_limits(server.find, axis, server.label)
    if limits.wrap is not None:
        raise DriveRefused(
            f"{server.label}: positions wrap around (607B) within the limits of the drives file: "
            "the drive would not hold its position after homing; home it with the maker's tool"
        )
    _refuse(server, limits.apply_to(axis), homing)
    intent = (
        f"Power on {axis.name} alone and let it home by method {homing.method} at up to "
        f"{format_coordinate(axis, homing.velocity)}/s? It may move as far as its switches."
    )
    require_consent(operator, intent)
    keeper = keeper or SettingsKeeper()
    keeper.later = objects.HOMING
    with ServoAxes(bus, alone, anywhere=True, keeper=keeper) as axes:
        session = _Session(axes, operator)
        scale, entries = AxisScale.derive(axis), session.server
        entries.set(objects.HOMING_METHOD, homing.method)
        entries.set(objects.HOME_OFFSET, scale.position_to_counts(homing.position))
        for entry, value in (
            (objects.HOMING_SPEED, scale.velocity_to_counts(homing.velocity)),
            (objects.HOMING_CREEP, scale.velocity_to_counts(homing.creep)),
            (objects.HOMING_ACCELERATION, scale.acceleration_to_counts(homing.acceleration)),
        ):
            entries.set_if_present(entry, value, "the drive's own homing value is used")
        session.change_mode(Mode.HOMING)
        session.run(homing.method, patience)
        session.change_mode(Mode.PROFILE_POSITION)
        return axes.follow().q[0]


def _refuse(server: RemoteDictionary, axis: AxisDrive, homing: Homing) -> None:
    supported = server.find(objects.SUPPORTED_MODES)
    if supported is not None and not supported & Mode.PROFILE_POSITION.supported_bit:
        raise DriveRefused(
            f"{server.label}: no profile position mode (6502 = {supported:08X}h, bit 0 is clear),"
            " in which it would hold its position after homing; home it with the maker's tool"
        )
    if supported is not None and not supported & Mode.HOMING.supported_bit:
        raise DriveRefused(
            f"{server.label}: no homing mode (6502 = {supported:08X}h, bit 5 is clear); move the "
            "axis to a mark instead and state the position there, now "
            f"{server.get(objects.POSITION)}, as zero"
        )
    fastest = SLOW * axis.limits.velocity
    for key, value in (("velocity", homing.velocity), ("creep", homing.creep)):
        if value > fastest:
            raise LimitExceeded(
                f"{axis.name}: homing.{key} {format_coordinate(axis, value)}/s must be at most "
                f"{format_coordinate(axis, fastest)}/s, {SLOW:.0%} of its limit; lower it"
            )


class _Session:
    """Powered axis under control of its drive."""

    def __init__(self, axes: ServoAxes, operator: Operator) -> None:
        self.server = axes.servers[0]
        self._axes, self._operator = axes, operator

    def change_mode(self, mode: Mode) -> None:
        """Write a mode and wait until the drive shows it."""
        self.server.put(objects.CONTROLWORD, ENABLED)
        self.server.put(objects.MODE, mode)
        if not self._wait(lambda: self.server.get(objects.MODE_DISPLAY) == mode, MODE_TIME):
            raise DriveRefused(
                f"{self.server.label}: does not take mode {mode.value} while powered: 6061 shows "
                f"{self.server.get(objects.MODE_DISPLAY)}; home it with the maker's tool"
            )

    def run(self, method: int, patience: float) -> None:
        """Start homing and wait for its end."""
        self.server.put(objects.CONTROLWORD, _START)
        if not self._wait(self._is_attained, patience):
            raise MoveFailed(
                f"{self.server.label}: no reference found by method {method} in {patience:g} s; "
                "check switches and direction, or allow more time with --patience"
            )
        self.server.put(objects.CONTROLWORD, ENABLED)

    def _is_attained(self) -> bool:
        word = self.server.get(objects.STATUSWORD)
        if word & _ERROR:
            raise MoveFailed(
                f"{self.server.label}: the drive reports a homing error (statusword {word:04X}h); "
                "check the method, its switches and the load"
            )
        return bool(word & _ATTAINED and word & Status.TARGET_REACHED)

    def _wait(self, holds: Callable[[], bool], patience: float) -> bool:
        begin = self._axes.follow().time
        ends, due = begin + patience, begin + POLLED
        while (time := self._axes.follow().time) < ends:
            pressed(self._operator)
            if time >= due:
                due = time + POLLED
                if holds():
                    return True
        return False
