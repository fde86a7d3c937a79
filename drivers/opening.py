"""The buses that there are, by what names them: this is where one is chosen and opened.

All else sees `drivers.session.connection.Fieldbus` and `drivers.dictionary.bus_rules.BusRules`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.can_bus.frame_log import logged
from drivers.can_bus.opening import open_can_bus
from drivers.canopen.bus import CanopenBus
from drivers.canopen.bus_load import cycle_on_bus
from drivers.canopen.eds_file import read_eds
from drivers.canopen.rules import RULES
from drivers.drive_bus import BusUnavailable
from drivers.ethercat.bus import EthercatBus
from drivers.ethercat.esi_file import read_esi
from drivers.ethercat.rules import RULES as ETHERCAT_RULES
from drivers.ethercat.wire import RawWire
from drivers.session.servo_axes import ServoAxes

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from drivers.dictionary.bus_rules import BusRules
    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import PacingName
    from drivers.found_settings.keeping import SettingsKeeper
    from drivers.session.connection import Fieldbus

ETHERCAT = "ethercat"
"""Interface of EtherCAT drives; its channel is a network interface."""
__all__ = [
    "ETHERCAT",
    "RULES",
    "cycle_on_bus",
    "open_drive_bus",
    "open_fieldbus",
    "read_eds",
    "read_esi",
    "rules_of",
]


def rules_of(interface: str | None) -> BusRules:
    """Return what a bus has of its own in dictionaries, by the interface that drives are on."""
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
        As python-can names them, or `ETHERCAT` and a network interface.
    options : mapping
        Further arguments of the interface, the bit rate among them.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.canopen.sync_clock.choose_sync_clock`, `drivers.ethercat.bus.EthercatBus`.
    frame_log : path, optional
        Where to log all frames (see `drivers.can_bus.frame_log`).

    Raises
    ------
    BusUnavailable
        No such interface or channel, or it cannot be opened, with the remedy.
    FileError
        The log of frames cannot be written.
    """
    if interface == ETHERCAT:
        if frame_log is not None:
            raise BusUnavailable(
                "frames of EtherCAT are not logged; record them beside with tcpdump or Wireshark"
            )
        return EthercatBus(RawWire(channel), pacing)
    bus = open_can_bus(interface, channel, options)
    return CanopenBus(bus if frame_log is None else logged(bus, frame_log), pacing)


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
    """Open a bus and put servo axes on it, which shut it down when left.

    Parameters
    ----------
    drives : DrivesFile
        The axes in joint order, and the bit rate.
    interface, channel, bus_options, pacing, frame_log
        See `open_fieldbus`, which says what is raised.
    keeper, feed_forward
        See `ServoAxes`.
    """
    options = {"bitrate": drives.bitrate, **(bus_options or {})}
    bus = open_fieldbus(interface, channel, options, pacing, frame_log)
    try:
        return ServoAxes(bus, drives, owns_bus=True, keeper=keeper, feed_forward=feed_forward)
    except BaseException:
        bus.shutdown()
        raise
