"""Opening a python-can bus, with errors that name the remedy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import can
from can.interfaces import BACKENDS

from drivers.drive_bus import BusUnavailable

if TYPE_CHECKING:
    from collections.abc import Mapping


def open_can_bus(interface: str, channel: str, options: Mapping[str, Any]) -> can.BusABC:
    """Open a bus from what is given alone, ignoring python-can's configuration files.

    Raises
    ------
    BusUnavailable
        No such interface or channel, a missing driver, or options that it does not take.
    """
    if interface not in BACKENDS:
        raise BusUnavailable(
            f"interface {interface!r} is unknown to python-can; choose one of "
            f"{', '.join(sorted(BACKENDS))}"
        )
    try:
        return can.Bus(channel, interface, ignore_config=True, **options)
    except Exception as error:  # back ends without their vendor's library raise what they like
        raise BusUnavailable(
            f"{interface} channel {channel!r} cannot be opened: {error}; "
            f"{_remedy(interface, channel, options)}"
        ) from error


def _remedy(interface: str, channel: str, options: Mapping[str, object]) -> str:
    if interface == "socketcan":
        bitrate = options.get("bitrate", 1_000_000)
        return (
            f"list interfaces with `ip link`, bring it up with "
            f"`ip link set {channel} up type can bitrate {bitrate}`"
        )
    return "check channel and options, that the adapter is plugged in and its driver installed"
