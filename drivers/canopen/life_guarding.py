"""Life guarding (CiA 301), for drives that cannot watch our heartbeat.

The master asks each such node for its state at intervals, by a remote frame under the identifier of
its heartbeat. The node answers with a toggle bit and its NMT state, which is as good as a heartbeat
to us; and when no request comes for its life time (guard time 100C times life time factor 100D) it
reacts as to a lost heartbeat (6007). Its own heartbeat has to be off, since a node does either.

Requests go out with our heartbeat and stop with it, so that both kinds of drives stop alike.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import can

from drivers.canopen import objects as cia301
from drivers.canopen.readback import LONGER_WATCH
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from drivers.canopen.sdo import RemoteDictionary
    from drivers.drives_file import DrivesFile

ERROR_CONTROL = 0x700
FACTOR_MAX = 0xFF


def guarding_request(node: int) -> can.Message:
    """Return the remote frame that asks a node for its state."""
    return can.Message(
        arbitration_id=ERROR_CONTROL + node, is_remote_frame=True, is_extended_id=False, dlc=1
    )


def can_be_guarded(server: RemoteDictionary) -> bool:
    """Whether a drive has the objects of life guarding."""
    entries = (cia301.GUARD_TIME, cia301.LIFE_TIME_FACTOR)
    return all(server.find(entry) is not None for entry in entries)


def set_up_life_guarding(server: RemoteDictionary, drives: DrivesFile) -> None:
    """Have a drive stop when our guarding requests stay away for `heartbeat_timeout`.

    Raises
    ------
    DriveRefused
        It keeps a life time that is none, too short for our requests, or much longer.
    """
    if server.find(cia301.PRODUCER_HEARTBEAT):
        server.set(cia301.PRODUCER_HEARTBEAT, 0)
    timeout, period = 1000 * drives.heartbeat_timeout, 1000 * drives.heartbeat_period
    factor = min(round(timeout / period), FACTOR_MAX)
    kept = 1
    for entry, value in (
        (cia301.GUARD_TIME, round(timeout / factor)),
        (cia301.LIFE_TIME_FACTOR, factor),
    ):
        server.put(entry, value)
        server.kept[entry] = server.get(entry)
        kept *= server.kept[entry]
    least, most = 2 * period, LONGER_WATCH * timeout
    if not least <= kept <= most:
        raise DriveRefused(
            f"{server.label}: keeps a life time (100C times 100D) of {kept} ms after {timeout:g} ms"
            f" were written, must be {least:g} to {most:g} ms; without it the axis goes on when"
            " this process dies: choose heartbeat_period and heartbeat_timeout that it takes"
        )
    server.notes.append(
        f"{server.label}: no heartbeats both ways (1016, 1017): it watches our guarding requests "
        f"instead and stops when none comes for {kept / 1000:g} s (100C, 100D)"
    )
