"""A drive bus from what names a bus: opened, logged if wished, and shut down with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.can_bus.frame_log import logged
from drivers.can_bus.opening import open_can_bus
from drivers.canopen_bus import CanopenDriveBus

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from drivers.canopen.sync_clock import PacingName
    from drivers.drives_file import DrivesFile
    from drivers.found_settings.keeping import SettingsKeeper


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
) -> CanopenDriveBus:
    """Open a python-can bus and put a `CanopenDriveBus` on it, which shuts it down when left.

    Parameters
    ----------
    drives : DrivesFile
        The axes in joint order, and the bit rate.
    interface, channel : str
        As python-can names them.
    bus_options : mapping, optional
        Further arguments of the interface.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.canopen.sync_clock.choose_sync_clock`.
    frame_log : path, optional
        Where to log all frames (see `drivers.can_bus.frame_log`).
    keeper : SettingsKeeper, optional
    feed_forward : bool
        See `CanopenDriveBus`.

    Raises
    ------
    BusUnavailable
        No such interface or channel, or it cannot be opened, with the remedy.
    FileError
        The log of frames cannot be written.
    """
    options = {"bitrate": drives.bitrate, **(bus_options or {})}
    bus = open_can_bus(interface, channel, options)
    if frame_log is not None:
        bus = logged(bus, frame_log)
    try:
        return CanopenDriveBus(
            bus,
            drives,
            pacing=pacing,
            owns_bus=True,
            keeper=keeper,
            feed_forward=feed_forward,
        )
    except BaseException:
        bus.shutdown()
        raise
