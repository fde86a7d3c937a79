"""`hil drives jog`: slow relative motion of an axis, without power on other axes.

The other axes stay unpowered, held by their brakes. Distance and velocity are checked against the
limits before anything is powered on, the operator consents to the actual numbers, and the move is
supervised as in a check.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.axis import Axis
from drivers.cia402 import objects
from drivers.cia402.set_point_limits import check_move
from drivers.commissioning.effective_limits import effective_limits
from drivers.drive_bus import LimitExceeded
from drivers.operator_tools.operator import require_consent
from drivers.operator_tools.small_move import format_coordinate, small_move, travel
from drivers.session.servo_axes import ServoAxes

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.found_settings.keeping import SettingsKeeper
    from drivers.operator_tools.operator import Operator
    from drivers.operator_tools.small_move import Stroke
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
        Drives file of the axis.
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
