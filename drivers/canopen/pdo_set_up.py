"""PDO set-up by SDO, with every step read back.

Mapping and identifier may be changed only while the PDO is off. The order is: off (bit 31 of the
COB-ID), identifier, transmission type, count 0, entries, count n, on. Some drives have fixed PDOs,
in part or as a whole; a fixed setting is accepted if suitable, and the drive is refused otherwise.
A fixed TPDO may have any order and further objects. A fixed RPDO must match exactly, since the
target has to precede the controlword that makes it valid; it may also act at SYNC: set-points and
stops then take effect at the next one. A drive without an RPDO for streamed set-points, or with
none that acts at SYNC, takes them by RPDO 1.

Other TPDOs are switched off; a TPDO that stays on is only reported, since it may be harmless.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, NoReturn

from drivers.canopen.objects import NO_REMOTE, OFF
from drivers.canopen.pdo_mapping import (
    Inputs,
    arrangements,
    fed_forward,
    fed_on_arrival,
    led,
    mapped,
    received,
    transmitted,
)
from drivers.cia402.objects import SUPPORTED_MODES
from drivers.cia402.states import Mode
from drivers.commissioning.held_values import NO_ROOM, content, mapping_count, mapping_slot
from drivers.drive_bus import DriveRefused
from drivers.fieldbus import Entry
from drivers.in_node import PDOS
from drivers.remote_dictionary import FIXED_CODES, Aborted

if TYPE_CHECKING:
    from drivers.canopen.pdo_mapping import Pdo
    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary


class OtherTpdo(NamedTuple):
    """An unused TPDO that cannot be switched off.

    Attributes
    ----------
    name : str
        Name in messages.
    cob_id : int
        COB-ID with the flags in bits 29 to 31.
    transmission : int or None
        Transmission type; None if unknown.
    """

    name: str
    cob_id: int
    transmission: int | None


class _TooShort(DriveRefused):
    """A writable mapping has room for fewer objects than needed."""


class _Unsuitable(DriveRefused):
    """A fixed mapping lacks a needed object."""


def set_up_pdos(
    server: RemoteDictionary, axis: AxisDrive, *, feed_forward: bool = False
) -> tuple[tuple[Pdo, ...], Inputs, tuple[OtherTpdo, ...]]:
    """Set up our PDOs and switch off other TPDOs; return TPDOs, RPDOs, and TPDOs still on.

    Parameters
    ----------
    server : RemoteDictionary
    axis : AxisDrive
        Axis as stated in the drives file.
    feed_forward : bool
        True to map offsets of velocity and torque to an RPDO.

    Raises
    ------
    DriveRefused
        A fixed PDO with other objects, or a value that reads back differently.
    """
    sent = _set_up_sending(server, axis)
    expected, found = _shown(transmitted(axis)), _shown(sent)
    if found != expected and axis.tpdos is not None:
        raise DriveRefused(
            f"{server.label}: its TPDOs carry {found}, the drives file states {expected}; correct "
            "tpdos"
        )
    if found != expected:
        server.note(
            f"the fixed mapping of its TPDOs is used; state tpdos: {found} in the drives file, "
            "for hil drives monitor and the bus load"
        )
    inputs = _set_up_receiving(server, axis, feed_forward=feed_forward)
    others = [_switch_off(server, number) for number in range(len(sent), PDOS)]
    return sent, inputs, tuple(other for other in others if other is not None)


def _set_up_sending(server: RemoteDictionary, axis: AxisDrive) -> tuple[Pdo, ...]:
    """Set up the first possible arrangement of TPDOs, or raise the refusal of the first."""
    first, *rest = arrangements(axis)
    try:
        return tuple(_set_up(server, pdo) for pdo in first)
    except _TooShort:
        if not rest:
            raise
    except _Unsuitable:
        # TPDO 2 must carry the current already
        current = rest[0][-1] if rest else None
        if (
            current is None
            or server.find(mapping_count(current.mapping)) is None
            or not set(current.entries) <= set(_content(server, current))
        ):
            raise
    return tuple(_set_up(server, pdo) for pdo in rest[0])


def _set_up_receiving(server: RemoteDictionary, axis: AxisDrive, *, feed_forward: bool) -> Inputs:
    """Set up the RPDO for commands, and those for streaming if the drive supports streaming."""
    command = _set_up(server, received(axis))
    modes = server.find(SUPPORTED_MODES)
    follows = modes is None or bool(modes & Mode.CYCLIC_POSITION.supported_bit)
    try:
        target = _set_up(server, led(axis)) if follows else None
        return Inputs(
            command, target, _set_up_offsets(server, fed_forward(axis), wanted=feed_forward)
        )
    except DriveRefused:
        offsets = _set_up_offsets(server, fed_on_arrival(axis), wanted=feed_forward)
        return Inputs(command, command, offsets)


def _set_up_offsets(server: RemoteDictionary, pdo: Pdo, *, wanted: bool) -> Pdo | None:
    if not wanted:
        return None
    for entry in pdo.entries:
        if server.find(entry) is None:
            raise DriveRefused(
                f"{server.label}: no object {entry}, needed for feed-forward; stream without "
                "feed-forward (hil run), or use a drive or firmware that has it"
            )
    return _set_up(server, pdo)


def _shown(pdos: tuple[Pdo, ...]) -> str:
    words = (", ".join(f"0x{e.word:08X}" for e in pdo.entries) for pdo in pdos)
    return "[" + ", ".join(f"[{each}]" for each in words) + "]"


def _set_up(server: RemoteDictionary, pdo: Pdo) -> Pdo:
    """Set up a PDO; return the PDO with the actual content."""
    cob = Entry(pdo.communication, 1, "u32", f"COB-ID of {pdo.name}")
    # drives differ in whether bit 30 can be changed, so it is left unchanged
    present = server.get(cob)
    identifier = present & NO_REMOTE | pdo.cob_id
    off = server.set_unless_fixed(cob, present | OFF)
    if off and present | OFF != identifier | OFF:
        server.set(cob, identifier | OFF)
    kind = Entry(pdo.communication, 2, "u8", f"transmission type of {pdo.name}")
    transmission = pdo.transmission
    if not server.set_unless_fixed(kind, transmission):
        transmission = server.get(kind)
        if transmission not in {pdo.transmission, *pdo.also}:
            _refuse_fixed(server, kind, f"{transmission}", f"{pdo.transmission}")
    # a TPDO must follow each SYNC: neither held back for a time nor sent in between
    for subindex, name in ((3, "inhibit time"), (5, "event timer")) if pdo.sends else ():
        timer = Entry(pdo.communication, subindex, "u16", f"{name} of {pdo.name}")
        time = server.find(timer)
        if time and not server.set_unless_fixed(timer, 0):
            _refuse_fixed(server, timer, f"{time}", "0")
    carried = _set_mapping(server, pdo, off=off)
    if server.get(cob) != identifier:
        server.set(cob, identifier)
    return pdo._replace(entries=carried, transmission=transmission)


def _set_mapping(server: RemoteDictionary, pdo: Pdo, *, off: bool) -> tuple[Entry, ...]:
    """Write a mapping, or accept a fixed one; return the mapped objects."""
    emptied = False
    try:
        server.set(mapping_count(pdo.mapping), 0)
        emptied = True
        for number, entry in enumerate(pdo.entries, start=1):
            server.set(mapping_slot(pdo.mapping, number), entry.word)
        server.set(mapping_count(pdo.mapping), len(pdo.entries))
    except Aborted as error:
        if emptied and error.code in NO_ROOM:
            raise _TooShort(str(error)) from error
        if error.code not in FIXED_CODES and off:
            raise
        return _accept_fixed(server, pdo)
    return pdo.entries


def _accept_fixed(server: RemoteDictionary, pdo: Pdo) -> tuple[Entry, ...]:
    """Return the objects of a fixed mapping, or refuse an unsuitable one."""
    carried = _content(server, pdo)
    if pdo.sends:
        fits = set(pdo.entries) <= set(carried)
        strange = [n for n, entry in enumerate(carried) if entry not in pdo.entries]
    else:
        fits = carried == pdo.entries
        pairs = zip(carried, (*pdo.entries, *carried), strict=False)
        strange = [n for n, (entry, wanted) in enumerate(pairs) if entry != wanted]
    odd = [n for n, entry in enumerate(carried) if entry.bits % 8]
    for n in odd:
        _refuse_fixed(
            server, mapping_slot(pdo.mapping, n + 1), f"{carried[n].word:X}h", "whole bytes"
        )
    if not fits:
        missing = next((e for e in pdo.entries if e not in carried), pdo.entries[0])
        place = mapping_slot(pdo.mapping, strange[0] + 1) if strange else mapping_count(pdo.mapping)
        present = f"{carried[strange[0]].word:X}h" if strange else f"{len(carried)}"
        _refuse_fixed(server, place, present, f"{missing.word:X}h")
    return carried


def _content(server: RemoteDictionary, pdo: Pdo) -> tuple[Entry, ...]:
    return mapped(content(server, pdo.mapping), pdo.entries)


def _switch_off(server: RemoteDictionary, number: int) -> OtherTpdo | None:
    """Switch a TPDO off; return the TPDO if that is impossible."""
    name = f"TPDO {number + 1}"
    cob = Entry(0x1800 + number, 1, "u32", f"COB-ID of {name}")
    present = server.find(cob)
    if present is None or present & OFF:
        return None
    try:
        server.put(cob, present | OFF)
    except Aborted as error:
        if error.code not in FIXED_CODES:
            raise
    present = server.get(cob)
    if present & OFF:
        return None
    kind = Entry(0x1800 + number, 2, "u8", f"transmission type of {name}")
    return OtherTpdo(name, present, server.find(kind))


def _refuse_fixed(server: RemoteDictionary, entry: Entry, present: str, wanted: str) -> NoReturn:
    raise _Unsuitable(
        f"{server.label}: object {entry} is fixed at {present}, {wanted} is needed; "
        "map it with the maker's commissioning tool or use another drive"
    )
