"""Process data of a drive: communication objects (ETG.1000.6 clause 5.6.7) and layout."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cycle_data import CODES
from drivers.fieldbus import Entry

if TYPE_CHECKING:
    from collections.abc import Iterable

    from drivers.drives_file import AxisDrive

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
    """Return a single mapping with our preferred content."""
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
