"""PDO set-up by explicit SDO, each step read back.

A mapping may be changed only while its PDO is off, and so may its identifier: off (bit 31 of the
COB-ID), identifier, transmission type, count 0, entries, count n, on. Some drives have fixed PDOs,
in part or as a whole; what is fixed is taken as it is if it carries what we need, and the drive is
refused otherwise. A fixed TPDO may carry it in any order, with other objects beside it. A fixed
RPDO must be the very one, since its target has to come before the controlword that makes it valid;
it may also act on SYNC: set-points and stops then take effect with the next one. A drive that has
no RPDO for the set-points of a stream, or none that acts at SYNC, takes them by RPDO 1.

What a drive sends beside that is switched off. A TPDO that cannot be is reported, for it may be
harmless.
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
    """A TPDO that we do not use and that cannot be switched off.

    Attributes
    ----------
    name : str
        For messages.
    cob_id : int
        Its COB-ID with the flags in bits 29 to 31.
    transmission : int or None
        Its transmission type; None where the drive does not say.
    """

    name: str
    cob_id: int
    transmission: int | None


class _TooShort(DriveRefused):
    """A mapping that can be written takes fewer objects than we need."""


class _Unsuitable(DriveRefused):
    """A fixed mapping does not carry what we need."""


def set_up_pdos(
    server: RemoteDictionary, axis: AxisDrive, *, feed_forward: bool = False
) -> tuple[tuple[Pdo, ...], Inputs, tuple[OtherTpdo, ...]]:
    """Map and switch on our PDOs, switch off other TPDOs; return both, and those that stay on.

    Parameters
    ----------
    server : RemoteDictionary
        The drive's object dictionary.
    axis : AxisDrive
        What the drives file states.
    feed_forward : bool
        An RPDO carries the offsets of velocity and torque.

    Raises
    ------
    DriveRefused
        A fixed PDO that carries something else, or a value that reads back differently.
    """
    sent = _set_up_sending(server, axis)
    _compare(server, axis, sent)
    inputs = _set_up_receiving(server, axis, feed_forward=feed_forward)
    others = [_switch_off(server, number) for number in range(len(sent), PDOS)]
    return sent, inputs, tuple(other for other in others if other is not None)


def _set_up_sending(server: RemoteDictionary, axis: AxisDrive) -> tuple[Pdo, ...]:
    """Set up the first arrangement that the drive can serve; the first refusal counts."""
    first, *rest = arrangements(axis)
    try:
        return tuple(_set_up(server, pdo) for pdo in first)
    except _TooShort:
        if not rest:
            raise
    except _Unsuitable:
        if not rest or not _carries(server, rest[0][-1]):
            raise
    return tuple(_set_up(server, pdo) for pdo in rest[0])


def _set_up_receiving(server: RemoteDictionary, axis: AxisDrive, *, feed_forward: bool) -> Inputs:
    """Set up what commands the drive, and what leads it along a path where it can follow one."""
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
                f"{server.label}: no object {entry}, so nothing can be fed forward to it; stream"
                " without feed-forward (hil run), or use a drive or firmware that has it"
            )
    return _set_up(server, pdo)


def _compare(server: RemoteDictionary, axis: AxisDrive, sent: tuple[Pdo, ...]) -> None:
    """Compare what the drive sends with what the drives file states, or note what to state."""
    expected, found = _shown(transmitted(axis)), _shown(sent)
    if found == expected:
        return
    if axis.tpdos is not None:
        raise DriveRefused(
            f"{server.label}: its TPDOs carry {found}, the drives file states {expected}; correct "
            "tpdos"
        )
    server.note(
        f"status, position and current come as its TPDOs have them; state tpdos: {found} in"
        " the drives file, for those who only listen (hil drives monitor) and for the bus load"
    )


def _shown(pdos: tuple[Pdo, ...]) -> str:
    words = (", ".join(f"0x{e.word:08X}" for e in pdo.entries) for pdo in pdos)
    return "[" + ", ".join(f"[{each}]" for each in words) + "]"


def _set_up(server: RemoteDictionary, pdo: Pdo) -> Pdo:
    """Set up one PDO; return it with what it carries in the end."""
    cob = Entry(pdo.communication, 1, "u32", f"COB-ID of {pdo.name}")
    # Drives differ in whether bit 30 can be changed, so it stays as it is.
    present = server.get(cob)
    identifier = present & NO_REMOTE | pdo.cob_id
    off = server.set_unless_fixed(cob, present | OFF)
    if off and present | OFF != identifier | OFF:
        server.set(cob, identifier | OFF)
    transmission = _set_transmission(server, pdo)
    if pdo.sends:
        _let_send(server, pdo)
    carried = _set_mapping(server, pdo, off=off)
    if server.get(cob) != identifier:
        server.set(cob, identifier)
    return pdo._replace(entries=carried, transmission=transmission)


def _set_transmission(server: RemoteDictionary, pdo: Pdo) -> int:
    kind = Entry(pdo.communication, 2, "u8", f"transmission type of {pdo.name}")
    if server.set_unless_fixed(kind, pdo.transmission):
        return pdo.transmission
    present = server.get(kind)
    if present not in {pdo.transmission, *pdo.also}:
        _refuse_fixed(server, kind, f"{present}", f"{pdo.transmission}")
    return present


def _let_send(server: RemoteDictionary, pdo: Pdo) -> None:
    """Have a TPDO sent with each SYNC: neither held back for a time nor sent in between."""
    for subindex, name in ((3, "inhibit time"), (5, "event timer")):
        entry = Entry(pdo.communication, subindex, "u16", f"{name} of {pdo.name}")
        present = server.find(entry)
        if present and not server.set_unless_fixed(entry, 0):
            _refuse_fixed(server, entry, f"{present}", "0")


def _set_mapping(server: RemoteDictionary, pdo: Pdo, *, off: bool) -> tuple[Entry, ...]:
    """Write a mapping, or take a fixed one; return what it carries."""
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
        return _taken(server, pdo)
    return pdo.entries


def _taken(server: RemoteDictionary, pdo: Pdo) -> tuple[Entry, ...]:
    """Return what a fixed mapping carries, if that is all that we need of it."""
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


def _carries(server: RemoteDictionary, pdo: Pdo) -> bool:
    """Whether a PDO carries what we need as it stands."""
    return server.find(mapping_count(pdo.mapping)) is not None and set(pdo.entries) <= set(
        _content(server, pdo)
    )


def _content(server: RemoteDictionary, pdo: Pdo) -> tuple[Entry, ...]:
    return mapped(content(server, pdo.mapping), pdo.entries)


def _switch_off(server: RemoteDictionary, number: int) -> OtherTpdo | None:
    """Switch a TPDO off; return it if it cannot be."""
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
