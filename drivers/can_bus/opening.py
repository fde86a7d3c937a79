"""Opening a python-can bus, with errors that name the remedy."""

from __future__ import annotations

import errno
from typing import TYPE_CHECKING, Any, cast

import can
from can.interfaces import BACKENDS

from drivers.drive_bus import BusUnavailable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from drivers.can_bus.local_bus import LocalBus

COMPANY = 5.0
"""Longest wait for another program on a local channel [s]."""
LINES = 5
"""Largest number of lines shown of an error."""
WITHOUT_ADAPTER = frozenset({"local", "replay", "sim_plant", "udp_multicast", "virtual"})
"""Interfaces without hardware."""


def open_can_bus(interface: str, channel: str, options: Mapping[str, Any]) -> can.BusABC:
    """Open a bus with the given arguments only, without python-can's configuration files.

    Raises
    ------
    BusUnavailable
        No such interface or channel, a missing driver, or invalid options.
    """
    if interface not in BACKENDS:
        raise BusUnavailable(
            f"interface {interface!r} is unknown to python-can; choose one of "
            f"{', '.join(sorted(BACKENDS))}"
        )
    try:
        bus = can.Bus(channel, interface, ignore_config=True, **options)
        if interface == "local":
            cast("LocalBus", bus).await_peer(COMPANY)
    except Exception as error:  # back ends without their vendor's library raise any type
        lines = str(error).splitlines()
        if (more := len(lines) - LINES) > 1:  # a file of another kind has an error in every line
            lines = [*lines[:LINES], f"... and {more} lines more"]
        shown = "\n".join(lines)
        raise BusUnavailable(
            f"{interface} channel {channel!r} cannot be opened: {shown}"
            f"{_remedy(interface, channel, options, error)}"
        ) from error
    return bus


def _remedy(interface: str, channel: str, options: Mapping[str, object], error: Exception) -> str:
    if interface == "socketcan":
        bitrate = options.get("bitrate", 1_000_000)
        up = (
            f"; list interfaces with `ip link`, bring it up with "
            f"`ip link set {channel} up type can bitrate {bitrate}`"
        )
        if isinstance(error, OSError) and error.errno == errno.EAFNOSUPPORT:
            return f"; this kernel has no SocketCAN: load can_raw, or use a host that has it{up}"
        return up
    if interface == "local":
        return ""  # its errors already end with a remedy
    if interface in WITHOUT_ADAPTER:
        return "; check channel and options"
    return "; check channel and options, and that the adapter is plugged in and has its driver"
