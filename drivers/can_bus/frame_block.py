"""Frames by the block: what a bus hands over at once is looked at at once.

A bus (`drivers.can_bus.capabilities.BlockSource`) may offer all frames that answer a SYNC as one
block of ``struct can_frame``, the kernel's own layout: identifier, length, three bytes of padding,
eight of data. When every frame of the block is one that is expected, one struct takes all values
out of it; building a message object for each frame would cost several times as much. Any other
block is taken apart frame by frame.
"""

from __future__ import annotations

import struct
from operator import itemgetter
from typing import TYPE_CHECKING

import can

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_FRAME = struct.Struct("=IB3x8s")
_DATA_MAX = 8


def messages(block: bytes) -> Iterator[can.Message]:
    """Take a block apart."""
    for identifier, size, data in _FRAME.iter_unpack(block):
        yield can.Message(arbitration_id=identifier, is_extended_id=False, data=data[:size])


def count_values(layout: str) -> int:
    """Return how many values a layout without repeat counts has, but for those of padding."""
    return sum(code.isalpha() and code != "x" for code in layout)


class FrameBlock:
    """The block in which every expected frame comes once, in the order of identifiers.

    Parameters
    ----------
    identifiers : sequence of int
        Of the expected frames.
    layouts : sequence of str
        struct codes of each frame's data; bytes that are of no interest are padding (x).
    order : sequence of int, optional
        Which values of the frames, counted through all of them, are returned in which order; by
        default all as they come.
    """

    def __init__(
        self,
        identifiers: Sequence[int],
        layouts: Sequence[str],
        order: Sequence[int] | None = None,
    ) -> None:
        ranks = sorted(range(len(identifiers)), key=identifiers.__getitem__)
        sizes = [struct.calcsize("<" + layout) for layout in layouts]
        self._struct = struct.Struct(
            "=" + "".join(f"IB3x{layouts[k]}{_DATA_MAX - sizes[k]}x" for k in ranks)
        )
        first, places = 0, {}
        for k in ranks:
            places[k] = first
            first += 2 + count_values(layouts[k])
        slots = range(len(identifiers))
        self._heads = itemgetter(*(place for k in slots for place in (places[k], places[k] + 1)))
        values = [places[k] + 2 + n for k in slots for n in range(count_values(layouts[k]))]
        self._values = itemgetter(*(values if order is None else [values[n] for n in order]))
        self._expected = tuple(
            part for pair in zip(identifiers, sizes, strict=True) for part in pair
        )
        self._data = [
            slice(16 * ranks.index(k) + 8, 16 * ranks.index(k) + 8 + sizes[k]) for k in slots
        ]

    def unpack(self, block: bytes) -> tuple[int, ...] | None:
        """Return the values of all frames in the order of `identifiers`; None if others came."""
        if len(block) != self._struct.size:
            return None
        fields = self._struct.unpack(block)
        return self._values(fields) if self._heads(fields) == self._expected else None

    def data(self, block: bytes) -> list[bytes]:
        """Return the data of each frame, in the order of `identifiers`."""
        return [block[place] for place in self._data]
