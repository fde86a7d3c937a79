"""Configuring how a drive communicates: SYNC, process data, emergencies, and who watches whom.

The drive watches us, by our heartbeat (1016) or, where it cannot do that, by guarding requests
(100C, 100D), so that it stops when this process dies. One that can do neither is refused unless the
drives file states what else stops the axis.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.communication import EXTENDED, IDENTIFIER, LAST_SYNCHRONOUS, ON_REQUEST, SYNC
from drivers.canopen.frame_length import frame_bits
from drivers.canopen.life_guarding import can_be_guarded, set_up_life_guarding
from drivers.canopen.pdo_set_up import OFF, set_up_pdos
from drivers.canopen.sdo import Aborted
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.canopen.communication import Communication
    from drivers.canopen.pdo_set_up import OtherTpdo
    from drivers.canopen.sdo import RemoteDictionary
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry

PDO_BYTES = 8
NODE_SHIFT, TIME_MASK = 16, 0xFFFF
"""A consumer heartbeat (1016): node and time [ms], which is 0 where the entry is not in use."""
WATCHED_MAX = 127
SYNC_PRODUCER, SYNC_RESERVED = 1 << 30, 1 << 31
"""Bits of 1005; the latter means nothing, and once meant that the drive consumes SYNC."""


def set_up_communication(
    server: RemoteDictionary,
    axis: AxisDrive,
    drives: DrivesFile,
    period: float,
    communication: Communication,
) -> None:
    """Configure a drive's communication; put what is found into `communication`.

    Raises
    ------
    DriveRefused, NodeSilent
        Why the drive cannot take part.
    """
    _set_up_sync(server, period)
    communication.transmitted, communication.others = set_up_pdos(server, axis)
    _note_others(server, communication.others, drives.bitrate, period)
    communication.emergency = _find_emergency(server)
    communication.guarded = _set_up_watch(server, axis, drives)


def _set_up_sync(server: RemoteDictionary, period: float) -> None:
    _listen_to_sync(server)
    _stop_counting(server)
    server.set_if_present(
        cia301.CYCLE_PERIOD, round(1e6 * period), "it does not know the period of SYNC"
    )


def _listen_to_sync(server: RemoteDictionary) -> None:
    """Have the drive listen to our SYNC and produce none, before it has a period to do so."""
    present = server.find(cia301.SYNC_COB_ID)
    if present is None:
        return
    wanted = present & SYNC_RESERVED | SYNC
    if present & SYNC_PRODUCER and present & ~SYNC_PRODUCER != wanted:
        present &= ~SYNC_PRODUCER  # its identifier is locked as long as it produces SYNC
        server.set(cia301.SYNC_COB_ID, present)
    if present != wanted:
        server.set(cia301.SYNC_COB_ID, wanted)


def _stop_counting(server: RemoteDictionary) -> None:
    """Have the drive expect SYNC without a counter, which it changes only without a period."""
    counter = server.find(cia301.SYNC_COUNTER)
    if not counter:
        return
    try:
        if server.find(cia301.CYCLE_PERIOD):
            server.put(cia301.CYCLE_PERIOD, 0)
        server.set(cia301.SYNC_COUNTER, 0)
    except DriveRefused as error:
        raise DriveRefused(
            f"{error}; it expects a counter in SYNC ({cia301.SYNC_COUNTER} is {counter}), and "
            "ours has none: set it to 0 with the maker's commissioning tool"
        ) from error


def _note_others(
    server: RemoteDictionary, others: Sequence[OtherTpdo], bitrate: int, period: float
) -> None:
    for other in others:
        kind = other.transmission
        if kind is not None and 0 < kind <= LAST_SYNCHRONOUS:
            load = frame_bits(PDO_BYTES) / kind / bitrate / period
            when = f"at every {kind}. SYNC" if kind > 1 else "at every SYNC"
            cost = f", which takes up to {load:.1%} of the bus"
        else:
            when, cost = "on request" if kind in ON_REQUEST else "on event", ""
        server.notes.append(
            f"{server.label}: {other.name} cannot be switched off: it goes on to be sent under "
            f"{other.cob_id & IDENTIFIER:03X}h {when}{cost}; nobody reads it"
        )


def _find_emergency(server: RemoteDictionary) -> int | None:
    """Return under which identifier emergencies come, None where the drive sends none."""
    present = server.find(cia301.EMERGENCY_COB_ID)
    if present is None:
        return 0x80 + server.node
    if present & (OFF | EXTENDED):
        server.notes.append(
            f"{server.label}: {cia301.EMERGENCY_COB_ID} is {present:08X}h: no emergencies come, "
            "so warnings stay unseen and the cause of a fault is read from the drive"
        )
        return None
    return present & IDENTIFIER


def _set_up_watch(server: RemoteDictionary, axis: AxisDrive, drives: DrivesFile) -> bool:
    """Have the drive watch us; return whether it does so by guarding requests."""
    watches = server.find(cia301.CONSUMER_HEARTBEAT) is not None
    beats = server.find(cia301.PRODUCER_HEARTBEAT) is not None
    if not (watches and beats) and can_be_guarded(server):
        set_up_life_guarding(server, drives)
        return True
    server.set(cia301.PRODUCER_HEARTBEAT, round(1000 * drives.heartbeat_period))
    if watches or axis.allow_no_heartbeat is None:
        _watch_us(server, drives.master_node, round(1000 * drives.heartbeat_timeout))
    else:
        server.notes.append(
            f"{server.label}: no object {cia301.CONSUMER_HEARTBEAT}: if this process dies, the "
            f"axis goes on to its target; allowed because: {axis.allow_no_heartbeat}"
        )
    return False


def _watch_us(server: RemoteDictionary, node: int, time: int) -> None:
    entry = _watching(server, node)
    try:
        server.set(entry, node << NODE_SHIFT | time)
    except DriveRefused as error:
        remedy = (
            "state allow_no_heartbeat with the reason in the drives file if something else stops it"
            if isinstance(error, Aborted) and error.missing
            else f"free an entry of 1016 with the maker's commissioning tool, for node {node}"
        )
        raise DriveRefused(
            f"{error}; without it the axis goes on when this process dies: {remedy}"
        ) from error


def _watching(server: RemoteDictionary, node: int) -> Entry:
    """Return the entry of 1016 by which a drive watches us already; by default the first.

    A node may stand in one entry only.
    """
    for number in range(1, WATCHED_MAX + 1):
        entry = replace(cia301.CONSUMER_HEARTBEAT, subindex=number)
        present = server.find(entry)
        if present is None:
            break
        if present >> NODE_SHIFT & 0xFF == node and present & TIME_MASK:
            return entry
    return cia301.CONSUMER_HEARTBEAT
