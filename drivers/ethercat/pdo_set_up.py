"""Process data set up by explicit SDO, each step read back.

A mapping may be changed while nothing is assigned, and what is assigned in PREOP only: assignment
0, mapping 0, entries, count n, assignment. A mapping with too little room goes on in the next.
Many drives have fixed mappings: then those are assigned that carry what we need, as they are. What
else they send to the drive goes on to be what the drive holds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.commissioning.held_values import (
    NO_ROOM,
    assignment_slot,
    content,
    mapping_count,
    mapping_slot,
)
from drivers.drive_bus import DriveRefused
from drivers.ethercat.objects import ASSIGNED_IN, ASSIGNED_OUT
from drivers.ethercat.process_layout import ROOM, Mapped, inputs_of, ours, outputs_of
from drivers.fieldbus import Entry
from drivers.remote_dictionary import ABSENT, FIXED_CODES, Aborted

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary

MAPPING_OUT, MAPPING_IN = 0x1600, 0x1A00
"""Those that we write where they can be written."""
REFUSALS = FIXED_CODES | ABSENT | {0x06010000, 0x06010003, 0x06040041, 0x06040042, 0x06040043}
"""A drive does not let process data be what we want."""
CANDIDATES = 8
"""Mappings that are looked at where they are fixed."""


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
    server: RemoteDictionary, assignment: int, mapping: int, entries: Sequence[Entry]
) -> Mapped:
    wanted, held = ours(mapping, entries), content(server, assignment, assignment_slot)
    if _content(server, held) == wanted:
        return wanted
    try:
        _assign(server, assignment, ())
        room = _write(server, mapping, wanted.words)
        if room:
            return _spread(server, assignment, mapping, wanted.words, room)
        _assign(server, assignment, wanted.mappings)
    except Aborted as error:
        if error.code not in REFUSALS:
            raise
        return _chosen(server, assignment, mapping, held, entries, error)
    return wanted


def _write(server: RemoteDictionary, mapping: int, words: Sequence[int]) -> int:
    """Write a mapping; return how many objects it takes if it does not take them all, else 0."""
    server.set(mapping_count(mapping), 0)
    for number, word in enumerate(words, start=1):
        try:
            server.set(mapping_slot(mapping, number), word)
        except Aborted as error:
            if number == 1 or error.code not in NO_ROOM:
                raise
            return number - 1
    server.set(mapping_count(mapping), len(words))
    return 0


def _spread(
    server: RemoteDictionary, assignment: int, mapping: int, words: Sequence[int], room: int
) -> Mapped:
    """Write objects into as many mappings as they need that take `room` each."""
    parts = [words[n : n + room] for n in range(0, len(words), room)]
    for number, part in enumerate(parts):
        _write(server, mapping + number, part)
    mappings = tuple(range(mapping, mapping + len(parts)))
    _assign(server, assignment, mappings)
    return Mapped(mappings, tuple(words))


def _chosen(
    server: RemoteDictionary,
    assignment: int,
    mapping: int,
    held: tuple[int, ...],
    entries: Sequence[Entry],
    refusal: Aborted,
) -> Mapped:
    """Return fixed mappings that carry what we need: those that were assigned, or others."""
    found = _content(server, held)
    if not found.carries(entries):
        found = _content(server, _covering(server, mapping, entries))
    if not found.carries(entries):
        missing = [str(e) for e in entries if not found.carries((e,))]
        raise DriveRefused(
            f"{server.label}: its process data are fixed ({refusal}) and no mapping from"
            f" {mapping:04X}h on carries {', '.join(missing)}; map it with the maker's"
            " commissioning tool, or use another drive"
        )
    if found.size > ROOM:
        raise DriveRefused(
            f"{server.label}: {assignment:04X}h assigns {found.size} bytes of process data, at"
            f" most {ROOM} are exchanged; assign fewer with the maker's commissioning tool"
        )
    _assign(server, assignment, found.mappings)
    return found


def _covering(server: RemoteDictionary, mapping: int, entries: Sequence[Entry]) -> tuple[int, ...]:
    """Return mappings that carry as much as possible of what we need, each once."""
    left, chosen = {entry.word for entry in entries}, list[int]()
    for index in range(mapping, mapping + CANDIDATES):
        if server.find(mapping_count(index)) is None:
            continue
        words = set(_content(server, (index,)).words)
        if words & left:
            chosen.append(index)
            left -= words
    return tuple(chosen)


def _assign(server: RemoteDictionary, assignment: int, mappings: tuple[int, ...]) -> None:
    if content(server, assignment, assignment_slot) == mappings:
        return
    server.set(mapping_count(assignment), 0)
    for number, mapping in enumerate(mappings, start=1):
        server.set(assignment_slot(assignment, number), mapping)
    if mappings:
        server.set(mapping_count(assignment), len(mappings))


def _content(server: RemoteDictionary, mappings: tuple[int, ...]) -> Mapped:
    """Read what mappings carry."""
    # an assignment without mapping is a gap
    words = [word for mapping in mappings if mapping for word in content(server, mapping)]
    return Mapped(mappings, tuple(words))


def others(mapped: Mapped, entries: Iterable[Entry]) -> tuple[Entry, ...]:
    """Return what else is carried, in whole bytes."""
    named = {entry.word for entry in entries}
    carried = [
        Entry(*key, f"u{8 * size}", "mapped beside") for key, (_, size) in mapped.places.items()
    ]
    return tuple(entry for entry in carried if entry.word not in named)
