"""What travels in the process data of one drive, and where it stands in them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cycle_data import CODES

if TYPE_CHECKING:
    from collections.abc import Iterable

    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

COMMAND = (objects.CONTROLWORD, objects.TARGET_POSITION)
Place = tuple[int, int]
"""Index and sub-index of an object; or its first byte and its size."""
STATE = (objects.STATUSWORD, objects.POSITION)
ROOM = 1024
"""Longest process data of a drive that are taken, in each direction [bytes]."""


@dataclass(frozen=True)
class Mapped:
    """What one direction of a drive's process data carries.

    Attributes
    ----------
    mappings : tuple of int
        Index of the mappings, in order.
    words : tuple of int
        All that they carry, each as index, sub-index and length in bits.
    """

    mappings: tuple[int, ...]
    words: tuple[int, ...]

    @property
    def size(self) -> int:
        """Length [bytes]."""
        return (sum(word & 0xFF for word in self.words) + 7) // 8

    @cached_property
    def places(self) -> dict[Place, Place]:
        """Where each object stands that is carried in whole bytes."""
        found: dict[Place, Place] = {}
        bit = 0
        for word in self.words:
            length, index = word & 0xFF, word >> 16
            if index and not (bit % 8 or length % 8):  # an entry without index is a gap
                found.setdefault((index, word >> 8 & 0xFF), (bit // 8, length // 8))
            bit += length
        return found

    def carries(self, entries: Iterable[Entry]) -> bool:
        """Whether all of these are in it, each in its own length."""
        return all(e.key in self.places and self.places[e.key][1] == e.size for e in entries)


def outputs_of(*, feed_forward: bool) -> tuple[Entry, ...]:
    """Return what a drive is sent: controlword and target, and what is fed forward."""
    return (*COMMAND, *objects.OFFSETS) if feed_forward else COMMAND


def inputs_of(axis: AxisDrive) -> tuple[Entry, ...]:
    """Return what a drive sends: statusword, position and current."""
    return (*STATE, axis.current.entry)


def ours(index: int, entries: Iterable[Entry]) -> Mapped:
    """Return the one mapping as we would have it."""
    return Mapped((index,), tuple(entry.word for entry in entries))


def picking(inputs: Mapped, axis: AxisDrive) -> tuple[str, list[int]]:
    """Return the layout of the inputs, and where in it statusword, position and current are."""
    entries = inputs_of(axis)
    starts = [inputs.places.get(entry.key, (0, 0))[0] for entry in entries]  # see `pdo_set_up`
    order = sorted(range(len(entries)), key=lambda n: starts[n])
    layout, end = "", 0
    for n in order:
        layout += f"{starts[n] - end}x{CODES[entries[n].type]}"
        end = starts[n] + entries[n].size
    return layout + f"{inputs.size - end}x", [order.index(n) for n in range(len(entries))]
