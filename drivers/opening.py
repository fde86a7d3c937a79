"""Choice and opening of a fieldbus by interface name.

Other modules see `drivers.session.connection.Fieldbus` and `drivers.dictionary.review.BusRules`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.eds_file import read_eds
from drivers.canopen.rules import RULES
from drivers.canopen.sync_rate import cycle_on_bus
from drivers.drive_bus import BusUnavailable
from drivers.ethercat.esi_file import read_esi
from drivers.ethercat.rules import RULES as ETHERCAT_RULES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from drivers.dictionary.review import BusRules
    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import PacingName
    from drivers.found_settings.keeping import SettingsKeeper
    from drivers.session.connection import Fieldbus
    from drivers.session.servo_axes import ServoAxes

ETHERCAT = "ethercat"
"""Interface name of EtherCAT drives; the channel is a network interface."""
__all__ = [
    "ETHERCAT", "RULES", "cycle_on_bus", "find_rules", "open_drive_bus", "open_fieldbus",
    "read_eds", "read_esi",
]  # fmt: skip


def find_rules(interface: str | None) -> BusRules:
    """Return the object dictionary rules of the bus behind an interface."""
    return ETHERCAT_RULES if interface == ETHERCAT else RULES


def open_fieldbus(
    interface: str,
    channel: str,
    options: Mapping[str, object],
    pacing: PacingName = "auto",
    frame_log: Path | None = None,
) -> Fieldbus:
    """Open a bus.

    Parameters
    ----------
    interface, channel : str
        Names as in python-can, or `ETHERCAT` and a network interface.
    options : mapping
        Further arguments of the interface, such as the bit rate.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.canopen.sync_clock.choose_sync_clock`, `drivers.ethercat.bus.EthercatBus`.
    frame_log : path, optional
        Log of frames to write (see `drivers.can_bus.frame_log`).

    Raises
    ------
    BusUnavailable
        Interface or channel does not exist or cannot be opened; with the remedy.
    FileError
        The frame log cannot be written.
    """
    if interface == ETHERCAT:
        from drivers.ethercat.bus import EthercatBus  # noqa: PLC0415 - a dry run opens no bus
        from drivers.ethercat.wire import RawWire  # noqa: PLC0415

        if frame_log is not None:
            raise BusUnavailable(
                "frames of EtherCAT are not logged; record them with tcpdump or Wireshark"
            )
        return EthercatBus(RawWire(channel), pacing)
    from drivers.can_bus.frame_log import log_frames  # noqa: PLC0415
    from drivers.can_bus.opening import open_can_bus  # noqa: PLC0415
    from drivers.canopen.bus import CanopenBus  # noqa: PLC0415

    bus = open_can_bus(interface, channel, options)
    return CanopenBus(bus if frame_log is None else log_frames(bus, frame_log), pacing)


def open_drive_bus(
    drives: DrivesFile,
    interface: str,
    channel: str,
    bus_options: Mapping[str, object] | None = None,
    pacing: PacingName = "auto",
    frame_log: Path | None = None,
    keeper: SettingsKeeper | None = None,
    *,
    feed_forward: bool = False,
) -> ServoAxes:
    """Open a bus and connect servo axes; the bus is shut down when the axes are left.

    Parameters
    ----------
    drives : DrivesFile
        Axes in joint order, and the bit rate.
    interface, channel, bus_options, pacing, frame_log
        See `open_fieldbus`, also for errors.
    keeper, feed_forward
        See `ServoAxes`.
    """
    from drivers.session.servo_axes import ServoAxes  # noqa: PLC0415

    options = {"bitrate": drives.bitrate, **(bus_options or {})}
    bus = open_fieldbus(interface, channel, options, pacing, frame_log)
    try:
        return ServoAxes(bus, drives, owns_bus=True, keeper=keeper, feed_forward=feed_forward)
    except BaseException:
        bus.shutdown()
        raise
