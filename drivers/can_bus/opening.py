"""Opening a python-can bus, with errors that name the remedy."""

from __future__ import annotations

import errno
from typing import TYPE_CHECKING, Any

import can
from can.interfaces import BACKENDS

from drivers.drive_bus import BusUnavailable

if TYPE_CHECKING:
    from collections.abc import Mapping

LINES = 5
"""Of an error's message that are shown."""
WITHOUT_ADAPTER = frozenset({"local", "replay", "sim_plant", "udp_multicast", "virtual"})
"""Interfaces that consist of software alone."""


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
            f"{interface} channel {channel!r} cannot be opened: {_shortened(str(error))}; "
            f"{_remedy(interface, channel, options, error)}"
        ) from error


def _shortened(text: str) -> str:
    """Leave out what a file of a wholly different kind has wrong in each of its lines."""
    lines = text.splitlines()
    more = len(lines) - LINES
    return "\n".join([*lines[:LINES], f"... and {more} lines more"] if more > 1 else lines)


def _remedy(interface: str, channel: str, options: Mapping[str, object], error: Exception) -> str:
    if interface == "socketcan":
        bitrate = options.get("bitrate", 1_000_000)
        up = (
            f"list interfaces with `ip link`, bring it up with "
            f"`ip link set {channel} up type can bitrate {bitrate}`"
        )
        if isinstance(error, OSError) and error.errno == errno.EAFNOSUPPORT:
            return (
                f"this kernel has no SocketCAN: load can_raw, or use a host that has it; then {up}"
            )
        return up
    if interface in WITHOUT_ADAPTER:
        return "check channel and options"
    return "check channel and options, that the adapter is plugged in and its driver installed"
