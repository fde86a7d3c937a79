"""`hil drives jog`: one axis by a stated relative way, slowly, with no other axis powered.

The other axes stay as they are, in their brakes. Way and velocity are checked against the limits
before anything is powered on, the operator agrees to the very numbers, and the move is watched as
in a check.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.axis import Axis
from drivers.cia402 import objects
from drivers.cia402.set_point_limits import check_move
from drivers.commissioning.effective_limits import effective_limits
from drivers.drive_bus import LimitExceeded
from drivers.operator_tools.operator import require_consent
from drivers.operator_tools.small_move import small_move, travel
from drivers.session.servo_axes import ServoAxes

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.found_settings.keeping import SettingsKeeper
    from drivers.operator_tools.operator import Operator
    from drivers.operator_tools.small_move import Stroke
    from drivers.session.connection import Fieldbus

SLOW = 0.2
"""Share of its velocity limit at which an axis may jog."""


def jog(
    bus: Fieldbus,
    drives: DrivesFile,
    axis: AxisDrive,
    way: float,
    velocity: float,
    operator: Operator,
    keeper: SettingsKeeper | None = None,
) -> Stroke:
    """Move one axis and return what was seen of it; the axis is off afterwards.

    Parameters
    ----------
    bus : Fieldbus
        An open bus.
    drives : DrivesFile
        The file that the axis is in.
    axis : AxisDrive
        Which.
    way, velocity : float
        Signed [rad or m], and at most `SLOW` of the limit [rad/s or m/s].
    operator : Operator
        Who agrees to it and may stop it.
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
            f"{axis.name}: {shown(axis, velocity)}/s must be at most {shown(axis, fastest)}/s, "
            f"{SLOW:.0%} of its limit; jog more slowly"
        )
    position = server.get(objects.POSITION)
    place = named.wrap.unwrap(position) if named.wrap else position
    start = named.scale.position_from_counts(float(place))
    move = small_move(held, start + way, velocity)
    check_move(move, named)
    intent = (
        f"Power on {axis.name} alone and move it from {shown(axis, start)} to "
        f"{shown(axis, move.target)} at {shown(axis, move.velocity)}/s?"
    )
    require_consent(operator, intent)
    with ServoAxes(bus, alone, keeper=keeper) as axes:
        return travel(axes, 0, held, move, operator)


def shown(axis: AxisDrive, value: float) -> str:
    """Put a joint coordinate [rad or m] into words, in degrees or mm."""
    if axis.joint == "prismatic":
        return f"{1000 * value + 0.0:.4g} mm"
    return f"{math.degrees(value) + 0.0:.4g}°"
