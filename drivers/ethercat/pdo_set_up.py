"""Process data set up by explicit SDO, each step read back.

A mapping may be changed while nothing is assigned, and what is assigned in PREOP only: assignment
0, mapping 0, entries, count n, assignment. Many drives have fixed mappings: then one that carries
what we need is looked for among those that are assigned, and it is taken as it is. What else such
a mapping sends to the drive goes on to be what the drive holds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.commissioning.held_values import (
    assignment_slot,
    mapping_count,
    mapping_slot,
)
from drivers.drive_bus import DriveRefused
from drivers.ethercat.objects import ASSIGNED_IN, ASSIGNED_OUT
from drivers.ethercat.process_layout import ROOM, Mapped, inputs_of, mapping_word, ours, outputs_of
from drivers.fieldbus import Entry
from drivers.remote_dictionary import ABSENT, FIXED_CODES, Aborted

if TYPE_CHECKING:
    from collections.abc import Iterable

    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary

MAPPING_OUT, MAPPING_IN = 0x1600, 0x1A00
"""Those that we write where they can be written."""
REFUSALS = FIXED_CODES | ABSENT | {0x06010000, 0x06010003, 0x06040041, 0x06040042, 0x06040043}
"""A drive does not let process data be what we want."""
LONGEST = 64
"""Most mappings, and objects in one, that are read."""


def set_up_process_data(
    server: RemoteDictionary, axis: AxisDrive, *, feed_forward: bool
) -> tuple[Mapped, Mapped]:
    """Map and assign what we use; return what outputs and inputs carry in the end.

    Raises
    ------
    DriveRefused
        Fixed process data that do not carry it.
    """
    outputs = _set_up(server, ASSIGNED_OUT, MAPPING_OUT, outputs_of(feed_forward=feed_forward))
    inputs = _set_up(server, ASSIGNED_IN, MAPPING_IN, inputs_of(axis))
    return outputs, inputs


def _set_up(
    server: RemoteDictionary, assignment: int, mapping: int, entries: Iterable[Entry]
) -> Mapped:
    wanted = ours(mapping, entries)
    if _content(server, assignment) == wanted:
        return wanted
    held = _held(server, assignment)
    try:
        _write(server, assignment, wanted)
    except Aborted as error:
        if error.code not in REFUSALS:
            raise
        return _taken(server, assignment, held, entries, error)
    return wanted


def _write(server: RemoteDictionary, assignment: int, wanted: Mapped) -> None:
    (mapping,) = wanted.mappings
    server.set(mapping_count(assignment), 0)
    server.set(mapping_count(mapping), 0)
    for number, word in enumerate(wanted.words, start=1):
        server.set(mapping_slot(mapping, number), word)
    server.set(mapping_count(mapping), len(wanted.words))
    server.set(assignment_slot(assignment, 1), mapping)
    server.set(mapping_count(assignment), 1)


def _taken(
    server: RemoteDictionary,
    assignment: int,
    held: tuple[int, ...],
    entries: Iterable[Entry],
    refusal: Aborted,
) -> Mapped:
    """Return what was assigned, as it was, if that is all that we need."""
    _assign(server, assignment, held)
    found = _content(server, assignment)
    if not found.carries(entries):
        missing = [str(e) for e in entries if not found.carries((e,))]
        raise DriveRefused(
            f"{server.label}: its process data are fixed ({refusal}) and what {assignment:04X}h"
            f" assigns does not carry {', '.join(missing)}; assign a mapping that does with the"
            " maker's commissioning tool, or use another drive"
        )
    if found.size > ROOM:
        raise DriveRefused(
            f"{server.label}: {assignment:04X}h assigns {found.size} bytes of process data, at"
            f" most {ROOM} are exchanged; assign fewer with the maker's commissioning tool"
        )
    return found


def _assign(server: RemoteDictionary, assignment: int, mappings: tuple[int, ...]) -> None:
    if _held(server, assignment) == mappings:
        return
    server.set(mapping_count(assignment), 0)
    for number, mapping in enumerate(mappings, start=1):
        server.set(assignment_slot(assignment, number), mapping)
    server.set(mapping_count(assignment), len(mappings))


def _held(server: RemoteDictionary, assignment: int) -> tuple[int, ...]:
    count = min(server.get(mapping_count(assignment)), LONGEST)
    return tuple(server.get(assignment_slot(assignment, n)) for n in range(1, count + 1))


def _content(server: RemoteDictionary, assignment: int) -> Mapped:
    """Read what is assigned, and what it carries."""
    mappings = _held(server, assignment)
    words: list[int] = []
    for mapping in mappings:
        if mapping:  # an assignment without mapping is a gap
            count = min(server.get(mapping_count(mapping)), LONGEST)
            words += (server.get(mapping_slot(mapping, n)) for n in range(1, count + 1))
    return Mapped(mappings, tuple(words))


def others(mapped: Mapped, entries: Iterable[Entry]) -> tuple[Entry, ...]:
    """Return what else is carried, in whole bytes."""
    named = {mapping_word(entry) for entry in entries}
    return tuple(
        Entry(word >> 16, word >> 8 & 0xFF, f"u{word & 0xFF}", "mapped beside")
        for word in mapped.words
        if word not in named and word >> 16 and mapped.place(word >> 16, word >> 8 & 0xFF)
    )
