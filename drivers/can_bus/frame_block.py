"""Frames by the block: what a bus hands over at once is looked at at once.

A bus in lock-step (`drivers.can_bus.capabilities.BlockSource`) may offer all frames that answer a
SYNC as one block of ``struct can_frame``: identifier, length, three bytes of padding, eight of
data. Whether each frame of a block is an expected one is one comparison of whole numbers, and one
struct takes all values out of it. Message objects for all frames would take several times as long.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from drivers.cycle_data import unpacking

if TYPE_CHECKING:
    from collections.abc import Sequence

_HEAD = struct.Struct("=IB3x")
_FRAME = 16
"""Size of ``struct can_frame`` [bytes]."""


class FrameBlock:
    """The block that holds each expected frame once, in the order of identifiers.

    Parameters
    ----------
    identifiers : sequence of int
        Of the expected frames.
    layouts : sequence of str
        struct codes of each frame's data, little endian.
    order : sequence of int
        Which values, counted through all frames as they are given, are returned in which order.
    """

    def __init__(
        self, identifiers: Sequence[int], layouts: Sequence[str], order: Sequence[int]
    ) -> None:
        ranks = sorted(range(len(identifiers)), key=identifiers.__getitem__)
        sizes = [struct.calcsize("<" + layout) for layout in layouts]
        counts = [len(struct.unpack("<" + layout, bytes(n)))
                  for layout, n in zip(layouts, sizes, strict=True)]  # fmt: skip
        as_given = [(k, value) for k, n in enumerate(counts) for value in range(n)]
        in_block = [(k, value) for k in ranks for value in range(counts[k])]
        data = "".join(f"8x{layouts[k]}{_FRAME - _HEAD.size - sizes[k]}x" for k in ranks)
        self._values = unpacking("<" + data, [in_block.index(as_given[n]) for n in order])
        self._heads = _joined([_HEAD.pack(identifiers[k], sizes[k]) for k in ranks])
        self._where_heads = _joined([b"\xff" * _HEAD.size for _ in ranks])
        self._size = _FRAME * len(ranks)
        begins = [_FRAME * ranks.index(k) + _HEAD.size for k in range(len(ranks))]
        self._data = [slice(at, at + n) for at, n in zip(begins, sizes, strict=True)]

    def unpack(self, block: bytes) -> tuple[int, ...] | None:
        """Return the values of all frames; None where one is missing, foreign or of other size."""
        if len(block) != self._size:
            return None
        heads = int.from_bytes(block, "little") & self._where_heads
        return self._values(block) if heads == self._heads else None

    def data(self, block: bytes) -> list[bytes]:
        """Return the data of each frame, in the order of `identifiers`."""
        return [block[place] for place in self._data]


def _joined(heads: Sequence[bytes]) -> int:
    """Return a block of frames with these heads and nothing else in them as a whole number."""
    return int.from_bytes(b"".join(head.ljust(_FRAME, b"\0") for head in heads), "little")
