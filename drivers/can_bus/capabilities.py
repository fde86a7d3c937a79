"""Capabilities of a bus beyond the interface of python-can.

A bus has a capability if it has a member of that name (`Capabilities`). A bus in front of another
one has only the capabilities in its `capabilities`: it passes on those that need no inspection or
timing of frames. No other module examines the type of a bus.

A bus in lock-step (`BlockSource`) may offer the answers to a SYNC as one block of
``struct can_frame``: identifier, length, three bytes of padding, eight of data. One comparison of
integers checks the heads of all frames, and one struct unpacks their values; message objects for
all frames would take several times as long.
"""

from __future__ import annotations

import struct
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, cast

from drivers.cycle_data import make_unpacker

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import can

_HEAD, _WHOLE = struct.Struct("=IB3x"), struct.Struct("=IB3x8s")
_FRAME = _WHOLE.size


class FrameBlock:
    """Block with every expected frame once, in the order of identifiers.

    Parameters
    ----------
    identifiers : sequence of int
        Identifiers of the expected frames.
    layouts : sequence of str
        struct codes of each frame's data, little endian.
    order : sequence of int
        Indices of the values to return, counted through the frames as given.
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
        self._values = make_unpacker("<" + data, [in_block.index(as_given[n]) for n in order])
        self._heads = _block_of_heads([_HEAD.pack(identifiers[k], sizes[k]) for k in ranks])
        self._where_heads = _block_of_heads([b"\xff" * _HEAD.size for _ in ranks])
        self._size = _FRAME * len(ranks)
        begins = [_FRAME * ranks.index(k) + _HEAD.size for k in range(len(ranks))]
        self._data = [slice(at, at + n) for at, n in zip(begins, sizes, strict=True)]

    def unpack(self, block: bytes) -> tuple[int, ...] | None:
        """Return the values of all frames; None if a frame is missing, foreign or misshapen."""
        if len(block) != self._size:
            return None
        heads = int.from_bytes(block, "little") & self._where_heads
        return self._values(block) if heads == self._heads else None

    def split(self, block: bytes) -> tuple[Iterable[tuple[int, int, bytes]], bytes]:
        """Return identifier, size and padded data of frames before the expected ones, and these."""
        others = len(block) - self._size
        return (_WHOLE.iter_unpack(block[:others]), block[others:]) if others else ((), block)

    def data(self, block: bytes) -> list[bytes]:
        """Return the data of each frame, in the order of `identifiers`."""
        return [block[place] for place in self._data]


def _block_of_heads(heads: Sequence[bytes]) -> int:
    """Return a block of frames with these heads and empty data, as an integer."""
    return int.from_bytes(b"".join(head.ljust(_FRAME, b"\0") for head in heads), "little")


class BlockSource(Protocol):
    """Bus with block reception: the answers to a SYNC at once."""

    def recv_block(self) -> bytes | None:
        """Return the waiting frames as ``struct can_frame``; None if `recv` must be used."""

    def put_back(self, block: bytes) -> None:
        """Return the frames of the last block to the queue of single frames."""

    def send_repeatedly(self, msg: can.Message, times: int) -> list[bytes]:
        """Send a SYNC up to `times` times, each after the answers to the previous SYNC.

        Returns
        -------
        list of bytes
            Blocks of answers to the SYNCs before the last; answers to the last are received as
            usual. Any news but process data, and heartbeats before them, end the repetition.
        """


@dataclass(frozen=True)
class Capabilities:
    """Capabilities of a bus.

    Attributes
    ----------
    lock_step : bool
        True if time may advance by SYNC alone: answers are queued before `send` returns.
    kernel_sync : bool
        True if the kernel runs `send_periodic` and returns sent frames with time stamps.
    clock : callable
        Clock of the bus [s].
    until_next_sent : callable, optional
        Time until the next sent frame of a recorded session [s].
    blocks : BlockSource, optional
        Block reception, if available.
    """

    lock_step: bool = False
    kernel_sync: bool = False
    clock: Callable[[], float] = time.perf_counter
    until_next_sent: Callable[[], float] | None = None
    blocks: BlockSource | None = None

    @property
    def recorded(self) -> bool:
        """True for a replay, without drives that could stay powered."""
        return self.until_next_sent is not None


def find_capabilities(bus: can.BusABC) -> Capabilities:
    """Return the capabilities of a bus."""
    from can.interfaces.socketcan import SocketcanBus  # noqa: PLC0415 - loads all of python-can

    stated: Capabilities | None = getattr(bus, "capabilities", None)
    return stated or Capabilities(
        lock_step=getattr(bus, "lock_step", False),
        kernel_sync=isinstance(bus, SocketcanBus),
        clock=getattr(bus, "clock", time.perf_counter),
        until_next_sent=getattr(bus, "until_next_sent", None),
        blocks=cast("BlockSource", bus) if hasattr(bus, "recv_block") else None,
    )
