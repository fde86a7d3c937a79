"""What travels in the process data of one drive, and where it stands in them."""

from __future__ import annotations

from dataclasses import dataclass
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

    def place(self, index: int, subindex: int) -> tuple[int, int] | None:
        """Return place and length of an object [bytes]; None where it is not in whole bytes."""
        bit = 0
        for word in self.words:
            length = word & 0xFF
            if word >> 8 == index << 8 | subindex:
                return None if bit % 8 or length % 8 else (bit // 8, length // 8)
            bit += length
        return None

    def carries(self, entries: Iterable[Entry]) -> bool:
        """Whether all of these are in it, each in its own length."""
        return all(
            (found := self.place(e.index, e.subindex)) is not None and found[1] == e.size
            for e in entries
        )


def outputs_of(*, feed_forward: bool) -> tuple[Entry, ...]:
    """Return what a drive is sent: controlword and target, and what is fed forward."""
    return (*COMMAND, *objects.OFFSETS) if feed_forward else COMMAND


def inputs_of(axis: AxisDrive) -> tuple[Entry, ...]:
    """Return what a drive sends: statusword, position and current."""
    return (*STATE, axis.current.entry)


def ours(index: int, entries: Iterable[Entry]) -> Mapped:
    """Return the one mapping as we would have it."""
    return Mapped((index,), tuple(entry.word for entry in entries))


def places(outputs: Mapped, start: int) -> dict[Place, Place]:
    """Return where in a frame each object stands that the outputs carry in whole bytes."""
    found = {}
    for word in outputs.words:
        index, subindex = word >> 16, word >> 8 & 0xFF
        place = outputs.place(index, subindex)
        if index and place is not None:
            found[index, subindex] = (start + place[0], place[1])
    return found


def picking(inputs: Mapped, axis: AxisDrive) -> tuple[str, list[int]]:
    """Return the layout of the inputs, and where in it statusword, position and current are."""
    entries = inputs_of(axis)
    places = [inputs.place(entry.index, entry.subindex) for entry in entries]
    starts = [place[0] if place else 0 for place in places]  # all are there, by `pdo_set_up`
    order = sorted(range(len(entries)), key=lambda n: starts[n])
    layout, end = "", 0
    for n in order:
        layout += f"{starts[n] - end}x{CODES[entries[n].type]}"
        end = starts[n] + entries[n].size
    return layout + f"{inputs.size - end}x", [order.index(n) for n in range(len(entries))]
