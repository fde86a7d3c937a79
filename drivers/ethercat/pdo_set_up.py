"""Process data of a drive: layout and set-up by SDO (ETG.1000.6 clause 5.6.7).

Every step of the set-up is read back.

A mapping may be changed while unassigned, and the assignment in PREOP only: assignment 0, mapping
0, entries, count n, assignment. A mapping with too little room is continued in the next one. Many
drives have fixed mappings: then those with the needed objects are assigned. Further objects in the
outputs keep the values of the drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.commissioning.held_values import (
    NO_ROOM,
    assignment_slot,
    content,
    mapping_count,
    mapping_slot,
)
from drivers.cycle_data import CODES
from drivers.drive_bus import DriveRefused
from drivers.fieldbus import Entry
from drivers.remote_dictionary import ABSENT, FIXED_CODES, Aborted

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary

ASSIGNED_OUT, ASSIGNED_IN = 0x1C12, 0x1C13
"""Assignment of mappings to outputs and inputs."""
CYCLES = (
    Entry(0x1C32, 2, "u32", "cycle time of outputs"),
    Entry(0x1C33, 2, "u32", "cycle time of inputs"),
)
SYNC_TYPES = (
    Entry(0x1C32, 1, "u16", "synchronization type of outputs"),
    Entry(0x1C33, 1, "u16", "synchronization type of inputs"),
)
BY_FRAMES, BY_SYNC0 = 1, 2
"""Synchronisation types: outputs act on frames, or at SYNC0."""
SYNC_TYPES_OFFERED = Entry(0x1C32, 4, "u16", "synchronization types supported")
OFFERS_SYNC0 = 0x0004
"""Bit of supported SYNC0 synchronisation."""
COMMAND = (objects.CONTROLWORD, objects.TARGET_POSITION)
Place = tuple[int, int]
"""Index and sub-index of an object; or offset and size of its bytes."""
STATE = (objects.STATUSWORD, objects.POSITION)
ROOM = 1024
"""Largest accepted process data of a drive, in each direction [bytes]."""


@dataclass(frozen=True)
class Mapped:
    """Content of a direction of a drive's process data.

    Attributes
    ----------
    mappings : tuple of int
        Index of the mappings, in order.
    words : tuple of int
        Mapped objects, each as index, sub-index and length in bits.
    """

    mappings: tuple[int, ...]
    words: tuple[int, ...]

    @property
    def size(self) -> int:
        """Length [bytes]."""
        return (sum(word & 0xFF for word in self.words) + 7) // 8

    @cached_property
    def places(self) -> dict[Place, Place]:
        """Offset and size of objects in whole bytes."""
        found: dict[Place, Place] = {}
        bit = 0
        for word in self.words:
            length, index = word & 0xFF, word >> 16
            if index and not (bit % 8 or length % 8):  # an entry without index is a gap
                found.setdefault((index, word >> 8 & 0xFF), (bit // 8, length // 8))
            bit += length
        return found

    def carries(self, entries: Iterable[Entry]) -> bool:
        """Return True if the entries are contained with the right lengths."""
        return all(e.key in self.places and self.places[e.key][1] == e.size for e in entries)


def outputs_of(*, feed_forward: bool) -> tuple[Entry, ...]:
    """Return the outputs of a drive: controlword and target, and feed-forward offsets."""
    return (*COMMAND, *objects.OFFSETS) if feed_forward else COMMAND


def inputs_of(axis: AxisDrive) -> tuple[Entry, ...]:
    """Return the inputs of a drive: statusword, position and current."""
    return (*STATE, axis.current.entry)


def ours(index: int, entries: Iterable[Entry]) -> Mapped:
    """Return a single mapping object with these entries."""
    return Mapped((index,), tuple(entry.word for entry in entries))


def locate_inputs(inputs: Mapped, axis: AxisDrive) -> tuple[str, list[int]]:
    """Return the layout of the inputs, and the indices of statusword, position and current."""
    entries = inputs_of(axis)
    starts = [inputs.places.get(entry.key, (0, 0))[0] for entry in entries]  # see `pdo_set_up`
    order = sorted(range(len(entries)), key=lambda n: starts[n])
    layout, end = "", 0
    for n in order:
        layout += f"{starts[n] - end}x{CODES[entries[n].type]}"
        end = starts[n] + entries[n].size
    return layout + f"{inputs.size - end}x", [order.index(n) for n in range(len(entries))]


MAPPING_OUT, MAPPING_IN = 0x1600, 0x1A00
"""Mappings written by us if writable."""
REFUSALS = FIXED_CODES | ABSENT | {0x06010000, 0x06010003, 0x06040041, 0x06040042, 0x06040043}
"""Abort codes of fixed process data."""
CANDIDATES = 8
"""Number of fixed mappings to examine."""


def set_up_process_data(
    server: RemoteDictionary, axis: AxisDrive, *, feed_forward: bool
) -> tuple[Mapped, Mapped]:
    """Map and assign our objects; return the actual content of outputs and inputs.

    Raises
    ------
    DriveRefused
        Fixed process data without a needed object.
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
        return _select_fixed(server, assignment, mapping, held, entries, error)
    return wanted


def _write(server: RemoteDictionary, mapping: int, words: Sequence[int]) -> int:
    """Write a mapping; return the number of objects that fit, 0 if all do."""
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
    """Write objects into several mappings with `room` objects each."""
    parts = [words[n : n + room] for n in range(0, len(words), room)]
    for number, part in enumerate(parts):
        _write(server, mapping + number, part)
    mappings = tuple(range(mapping, mapping + len(parts)))
    _assign(server, assignment, mappings)
    return Mapped(mappings, tuple(words))


def _select_fixed(
    server: RemoteDictionary,
    assignment: int,
    mapping: int,
    held: tuple[int, ...],
    entries: Sequence[Entry],
    refusal: Aborted,
) -> Mapped:
    """Assign fixed mappings with the needed objects: the present assignment, or other mappings."""
    found = _content(server, held)
    if not found.carries(entries):
        # mappings with as many needed objects as possible, each once
        left, chosen = {entry.word for entry in entries}, list[int]()
        for index in range(mapping, mapping + CANDIDATES):
            if server.find(mapping_count(index)) is not None:
                words = set(_content(server, (index,)).words)
                if words & left:
                    chosen.append(index)
                    left -= words
        found = _content(server, tuple(chosen))
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


def _assign(server: RemoteDictionary, assignment: int, mappings: tuple[int, ...]) -> None:
    if content(server, assignment, assignment_slot) == mappings:
        return
    server.set(mapping_count(assignment), 0)
    for number, mapping in enumerate(mappings, start=1):
        server.set(assignment_slot(assignment, number), mapping)
    if mappings:
        server.set(mapping_count(assignment), len(mappings))


def _content(server: RemoteDictionary, mappings: tuple[int, ...]) -> Mapped:
    """Read the content of mappings; an assignment without mapping is a gap."""
    words = [word for mapping in mappings if mapping for word in content(server, mapping)]
    return Mapped(mappings, tuple(words))


def others(mapped: Mapped, entries: Iterable[Entry]) -> tuple[Entry, ...]:
    """Return further objects in a mapping, in whole bytes."""
    named = {entry.word for entry in entries}
    carried = [
        Entry(*key, f"u{8 * size}", "also mapped") for key, (_, size) in mapped.places.items()
    ]
    return tuple(entry for entry in carried if entry.word not in named)
