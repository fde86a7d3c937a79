"""Set-up of mutual supervision: the drive stops when this process dies, and we notice its end.

The drive supervises our heartbeat (1016) and sends its own (1017). A drive that cannot do both may
supervise our guarding requests instead: without one for the life time (guard time 100C times life
time factor 100D) it reacts as to a lost heartbeat (6007). Its own heartbeat has to be off then,
since a node does either. A drive without either supervision is refused unless the drives file
states other means to stop the axis.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.requirements import (
    GUARDING,
    NODE_SHIFT,
    REQUIREMENTS,
    TIME_MASK,
    watching_time,
)
from drivers.commissioning.requirements import STATE_WHAT_STOPS
from drivers.drive_bus import DriveRefused
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.remote_dictionary import RemoteDictionary

WATCHED_MAX = 127
FACTOR_MAX = 0xFF

_GOES_ON = REQUIREMENTS[cia301.CONSUMER_HEARTBEAT].without


def set_up_watch(server: RemoteDictionary, axis: AxisDrive, drives: DrivesFile) -> bool:
    """Set up a drive's supervision of our life sign; return True if by guarding requests.

    Raises
    ------
    DriveRefused
        The drive has no supervision, and the drives file states no other means to stop the axis; or
        it keeps an unusable time.
    """
    watches = server.find(cia301.CONSUMER_HEARTBEAT) is not None
    beats = server.find(cia301.PRODUCER_HEARTBEAT) is not None
    guarded = not (watches and beats) and all(server.find(e) is not None for e in GUARDING)
    if guarded:
        _set_up_life_guarding(server, drives)
        return True
    server.set(cia301.PRODUCER_HEARTBEAT, round(1000 * drives.heartbeat_period))
    if watches or axis.allow_no_heartbeat is None:
        _supervise_heartbeat(server, drives.master_node, round(1000 * drives.heartbeat_timeout))
    else:
        excused = f"{_GOES_ON}; allowed because: {axis.allow_no_heartbeat}"
        server.do_without((cia301.CONSUMER_HEARTBEAT,), excused)
    return False


def _set_up_life_guarding(server: RemoteDictionary, drives: DrivesFile) -> None:
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
    least, most = watching_time(drives)
    if not least <= kept <= most:
        raise DriveRefused(
            f"{server.label}: keeps a life time (100C times 100D) of {kept} ms after {timeout:g} ms"
            f" were written, must be {least:g} to {most:g} ms; {_GOES_ON}: choose heartbeat_period"
            " and heartbeat_timeout that it takes"
        )
    server.note(
        "no heartbeats both ways (1016, 1017): it watches our guarding requests instead and stops"
        f" when none comes for {kept / 1000:g} s (100C, 100D)",
        lack=True,
    )


def _supervise_heartbeat(server: RemoteDictionary, node: int, time: int) -> None:
    """Write our node and the time [ms] to the entry of 1016 with our node, else to the first."""
    entry = cia301.CONSUMER_HEARTBEAT
    for number in range(1, WATCHED_MAX + 1):  # a node may be in one entry only
        other = replace(cia301.CONSUMER_HEARTBEAT, subindex=number)
        present = server.find(other)
        if present is None:
            break
        if present >> NODE_SHIFT & 0xFF == node and present & TIME_MASK:
            entry = other
            break
    try:
        server.set(entry, node << NODE_SHIFT | time)
    except DriveRefused as error:
        remedy = (
            STATE_WHAT_STOPS
            if isinstance(error, Aborted) and error.missing
            else f"free an entry of 1016 with the maker's commissioning tool, for node {node}"
        )
        raise DriveRefused(f"{error}; {_GOES_ON}: {remedy}") from error
