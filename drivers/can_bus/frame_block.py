"""Frames by the block: what a bus hands over at once is looked at at once.

A bus (`drivers.can_bus.capabilities.BlockSource`) may offer all frames that answer a SYNC as one
block of ``struct can_frame``, the kernel's own layout: identifier, length, three bytes of padding,
eight of data. Whether every frame of the block is one that is expected is one comparison of whole
numbers, and then one struct takes all values out of it; building a message object for each frame
would cost several times as much. Any other block is taken apart frame by frame.
"""

from __future__ import annotations

import struct
from operator import itemgetter
from typing import TYPE_CHECKING

import can

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

_FRAME = struct.Struct("=IB3x8s")
_HEAD = struct.Struct("=IB")
_DATA_MAX = 8


def messages(block: bytes) -> Iterator[can.Message]:
    """Take a block apart."""
    for identifier, size, data in _FRAME.iter_unpack(block):
        yield can.Message(arbitration_id=identifier, is_extended_id=False, data=data[:size])


def count_values(layout: str) -> int:
    """Return how many values a layout without repeat counts has, but for those of padding."""
    return sum(code.isalpha() and code != "x" for code in layout)


def unpacking(layout: str, order: Sequence[int]) -> Callable[[bytes], tuple[int, ...]]:
    """Return what unpacks a layout and returns its values in an order."""
    unpack = struct.Struct(layout).unpack
    if list(order) == list(range(count_values(layout))):
        return unpack
    pick = itemgetter(*order)
    return lambda data: pick(unpack(data))


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
        first, places = 0, {}
        for k in ranks:
            places[k] = first
            first += count_values(layouts[k])
        slots = range(len(identifiers))
        values = [places[k] + n for k in slots for n in range(count_values(layouts[k]))]
        self._values = unpacking(
            "=" + "".join(f"8x{layouts[k]}{_DATA_MAX - sizes[k]}x" for k in ranks),
            values if order is None else [values[n] for n in order],
        )
        heads = [_HEAD.pack(identifiers[k], sizes[k]) for k in ranks]
        self._size = _FRAME.size * len(heads)
        self._heads = _joined(heads)
        self._where_heads = _joined([b"\xff" * _HEAD.size] * len(heads))
        self._data = [
            slice(16 * ranks.index(k) + 8, 16 * ranks.index(k) + 8 + sizes[k]) for k in slots
        ]

    def unpack(self, block: bytes) -> tuple[int, ...] | None:
        """Return the values of all frames in the order of `identifiers`; None if others came."""
        if len(block) != self._size:
            return None
        heads = int.from_bytes(block, "little") & self._where_heads
        return self._values(block) if heads == self._heads else None

    def data(self, block: bytes) -> list[bytes]:
        """Return the data of each frame, in the order of `identifiers`."""
        return [block[place] for place in self._data]


def _joined(heads: Sequence[bytes]) -> int:
    """A block of frames with these heads and nothing else in them, as one whole number."""
    return int.from_bytes(b"".join(head.ljust(_FRAME.size, b"\0") for head in heads), "little")
