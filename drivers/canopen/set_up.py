"""Set-up of SYNC, emergencies and mutual supervision in a drive, and notes on PDOs.

Mutual supervision: the drive stops when this process dies, and the master notices the end of the
drive. The drive supervises the master's heartbeat (1016) and sends its own (1017). A drive that
cannot do both may supervise guarding requests instead: without a request for the life time (guard
time 100C times life time factor 100D) it reacts as to a lost heartbeat (6007). Its own heartbeat
has to be off then, since a node sends heartbeats or answers requests, not both. A drive without
either supervision is refused unless the drives file states other means to stop the axis.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.objects import EXTENDED, IDENTIFIER, LAST_SYNCHRONOUS, OFF, ON_REQUEST, SYNC
from drivers.canopen.rules import (
    GUARDING,
    NODE_SHIFT,
    ON_ARRIVAL,
    REQUIREMENTS,
    TIME_MASK,
    watching_time,
)
from drivers.canopen.sync_rate import frame_bits
from drivers.commissioning.requirements import STATE_WHAT_STOPS
from drivers.drive_bus import DriveRefused
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.canopen.pdo_mapping import Inputs
    from drivers.canopen.pdo_set_up import OtherTpdo
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
            f"{server.label}: keeps a life time (100C times 100D) of {kept} ms after {timeout:g} "
            f"ms were written, must be {least:g} to {most:g} ms; {_GOES_ON}: choose "
            "heartbeat_period and heartbeat_timeout that the drive accepts"
        )
    server.note(
        "no heartbeats both ways (1016, 1017): node guarding is used instead, the drive stops "
        f"after {kept / 1000:g} s without a request (100C, 100D)",
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


PDO_BYTES = 8
SYNC_PRODUCER, SYNC_RESERVED = 1 << 30, 1 << 31
"""Bits of 1005; the latter is obsolete and once marked a consumer of SYNC."""


def set_up_sync(server: RemoteDictionary, period: float) -> None:
    """Configure the drive for our SYNC: as consumer, without a counter, with the period."""
    present = server.find(cia301.SYNC_COB_ID)
    if present is not None:
        wanted = present & SYNC_RESERVED | SYNC
        # a producer must stop before it gets a period; until then its identifier is locked
        if present & SYNC_PRODUCER and present & ~SYNC_PRODUCER != wanted:
            present &= ~SYNC_PRODUCER
            server.set(cia301.SYNC_COB_ID, present)
        if present != wanted:
            server.set(cia301.SYNC_COB_ID, wanted)
    counter = server.find(cia301.SYNC_COUNTER)
    if counter:
        try:
            if server.find(cia301.CYCLE_PERIOD):  # the counter can be changed only without a period
                server.put(cia301.CYCLE_PERIOD, 0)
            server.set(cia301.SYNC_COUNTER, 0)
        except DriveRefused as error:
            raise DriveRefused(
                f"{error}; the drive needs a counter in SYNC ({cia301.SYNC_COUNTER} is {counter}), "
                "not sent here: set 1019 to 0 with the maker's commissioning tool"
            ) from error
    without = REQUIREMENTS[cia301.CYCLE_PERIOD].without
    server.set_if_present(cia301.CYCLE_PERIOD, round(1e6 * period), without)


def note_arrival(server: RemoteDictionary, inputs: Inputs) -> None:
    """Note set-points that act on arrival, for lack of an RPDO with action at SYNC."""
    kind, target = cia301.SET_POINT_TRANSMISSION, inputs.target
    if inputs.synchronous or target is None:
        return
    if server.find(kind) is None:
        server.do_without((kind,), ON_ARRIVAL)
    else:
        server.note(
            f"{target.name} carries its set-points, of type {target.transmission}: {ON_ARRIVAL}"
        )


def note_others(
    server: RemoteDictionary, others: Sequence[OtherTpdo], bitrate: int, period: float
) -> None:
    """Note unused TPDOs that cannot be switched off."""
    for other in others:
        kind = other.transmission
        if kind is not None and 0 < kind <= LAST_SYNCHRONOUS:
            load = frame_bits(PDO_BYTES) / kind / bitrate / period
            when = f"at every {kind}. SYNC" if kind > 1 else "at every SYNC"
            cost = f", which takes up to {load:.1%} of the bus"
        else:
            when, cost = "on request" if kind in ON_REQUEST else "on event", ""
        server.note(
            f"{other.name} cannot be switched off: still sent under "
            f"{other.cob_id & IDENTIFIER:03X}h {when}{cost}, not read"
        )


def find_emergency(server: RemoteDictionary) -> int | None:
    """Return the identifier of emergencies, None if the drive sends none."""
    present = server.find(cia301.EMERGENCY_COB_ID)
    if present is None:
        return 0x80 + server.node
    if present & (OFF | EXTENDED):
        server.note(
            f"{cia301.EMERGENCY_COB_ID} is {present:08X}h: no emergency messages, so warnings are "
            "not seen, and the cause of a fault is read from the drive"
        )
        return None
    return present & IDENTIFIER
