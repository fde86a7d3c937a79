"""Set-up of SYNC and emergencies in a drive, and notes on its PDOs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.objects import EXTENDED, IDENTIFIER, LAST_SYNCHRONOUS, OFF, ON_REQUEST, SYNC
from drivers.canopen.requirements import ON_ARRIVAL, REQUIREMENTS
from drivers.canopen.sync_rate import frame_bits
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.canopen.pdo_mapping import Inputs
    from drivers.canopen.pdo_set_up import OtherTpdo
    from drivers.remote_dictionary import RemoteDictionary

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
            if server.find(cia301.CYCLE_PERIOD):  # the counter can be changed only without one
                server.put(cia301.CYCLE_PERIOD, 0)
            server.set(cia301.SYNC_COUNTER, 0)
        except DriveRefused as error:
            raise DriveRefused(
                f"{error}; it expects a counter in SYNC ({cia301.SYNC_COUNTER} is {counter}), and "
                "ours has none: set it to 0 with the maker's commissioning tool"
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
            f"{other.name} cannot be switched off: it goes on to be sent under "
            f"{other.cob_id & IDENTIFIER:03X}h {when}{cost}; nobody reads it"
        )


def find_emergency(server: RemoteDictionary) -> int | None:
    """Return the identifier of emergencies, None if the drive sends none."""
    present = server.find(cia301.EMERGENCY_COB_ID)
    if present is None:
        return 0x80 + server.node
    if present & (OFF | EXTENDED):
        server.note(
            f"{cia301.EMERGENCY_COB_ID} is {present:08X}h: no emergencies come, "
            "so warnings stay unseen and the cause of a fault is read from the drive"
        )
        return None
    return present & IDENTIFIER
