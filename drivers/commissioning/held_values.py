"""Values held by a drive before writing: selection and reading."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.fieldbus import Entry
from drivers.remote_dictionary import RANGE_CODES, Aborted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.remote_dictionary import RemoteDictionary

COMMANDS = frozenset({0x6040, 0x6042, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60C1, 0x60FF})
"""Controlword and targets: commands, which are neither kept nor restored."""
MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))
"""Mappings of RPDOs and of TPDOs (CiA 301), also on EtherCAT."""
ASSIGNMENTS = range(0x1C12, 0x1C14)
"""Assignments of mappings to sync managers (ETG.1000.6), on EtherCAT only."""
ENTRIES_MAX = 64
"""Largest number of objects in a PDO (CiA 301)."""
NO_ROOM = RANGE_CODES | {0x06090011, 0x06040042}
"""Abort codes of a writable mapping without a further sub-index, or with too large a count or
length."""


def mapping_count(index: int) -> Entry:
    """Return the object with the number of objects in a mapping or assignment (1C12h, 1C13h)."""
    return Entry(index, 0, "u8", f"number of objects in {_name(index)}")


def mapping_slot(index: int, number: int) -> Entry:
    """Return the n-th object of a mapping, from 1."""
    return Entry(index, number, "u32", f"object {number} of {_name(index)}")


def assignment_slot(index: int, number: int) -> Entry:
    """Return the n-th mapping of an assignment, from 1."""
    return Entry(index, number, "u16", f"mapping {number} of {_name(index)}")


def content(
    server: RemoteDictionary, index: int, slot: Callable[[int, int], Entry] = mapping_slot
) -> tuple[int, ...]:
    """Read the content of a mapping or assignment (errors as in `RemoteDictionary.get`)."""
    count = min(server.get(mapping_count(index)), ENTRIES_MAX)
    return tuple(server.get(slot(index, number)) for number in range(1, count + 1))


def read_before_write(server: RemoteDictionary, entry: Entry) -> dict[Entry, int]:
    """Read the values to save before `entry` is written, except those saved already.

    Commands and missing objects are not saved. The objects of a PDO mapping belong together, and
    so do those of an assignment: a change of one invalidates them all.

    Raises
    ------
    NodeSilent, DriveRefused
        No answer, or another length than expected.
    """
    if entry.index in COMMANDS:
        return {}
    entries: Sequence[Entry] = [entry]
    if any(entry.index in mappings for mappings in MAPPINGS):
        entries = [*_mapped(server, entry.index, mapping_slot), entry]
    elif entry.index in ASSIGNMENTS:
        entries = [*_mapped(server, entry.index, assignment_slot), entry]
    fresh = {each.key: each for each in entries}
    values = {e: read_if_held(server, e) for place, e in fresh.items() if place not in server.saved}
    return {each: value for each, value in values.items() if value is not None}


def _mapped(server: RemoteDictionary, index: int, slot: Callable[[int, int], Entry]) -> list[Entry]:
    count = mapping_count(index)
    present = min(read_if_held(server, count) or 0, ENTRIES_MAX)
    return [count, *(slot(index, n) for n in range(1, present + 1))]


def read_if_held(server: RemoteDictionary, entry: Entry) -> int | None:
    """Read an object, None if it cannot be read."""
    try:
        return server.get(entry)
    except Aborted:  # missing or write-only: the write itself will report the reason
        return None


def _name(mapping: int) -> str:
    if mapping in ASSIGNMENTS:
        return f"{mapping:04X}"
    return f"TPDO {mapping - 0x19FF}" if mapping in MAPPINGS[1] else f"RPDO {mapping - 0x15FF}"
