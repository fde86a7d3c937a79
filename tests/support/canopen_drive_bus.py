"""Servo axes on an open python-can bus, used by most tests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drivers.canopen.bus import CanopenBus
from drivers.session.servo_axes import ServoAxes

if TYPE_CHECKING:
    import can

    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import PacingName


class CanopenDriveBus(ServoAxes):
    """CANopen drives as a `drivers.drive_bus.DriveBus`.

    Parameters
    ----------
    bus : can.BusABC
        An open bus.
    drives : DrivesFile
        The axes in joint order.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.canopen.sync_clock.choose_sync_clock`.
    **options
        See `drivers.session.servo_axes.ServoAxes`.
    """

    def __init__(
        self, bus: can.BusABC, drives: DrivesFile, *, pacing: PacingName = "auto", **options: Any
    ) -> None:
        super().__init__(CanopenBus(bus, pacing), drives, **options)
