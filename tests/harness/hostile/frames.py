"""Frames that no honest peer would send, drawn in batches with a seed.

A receiver's first check rejects nearly all pure noise, so most frames are almost valid: the right
identifier with wrong data, each command specifier of SDO (expedited, segmented, block) on objects
that exist, and frames of a real session with bits flipped, cut, lengthened or sent again. Some are
turned into remote, extended or error frames at last.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import can
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

NODES = range(1, 7)
BATCH = 8192

SERVICES = np.array(
    [0x000, 0x080, 0x100, 0x180, 0x200, 0x280, 0x300, 0x380, 0x400, 0x480, 0x500, 0x580, 0x600,
     0x680, 0x700, 0x780]
)  # fmt: skip
"""First identifier of each service of CiA 301, with LSS as the last."""

SPECIFIERS = np.array(
    [0x00, 0x01, 0x10, 0x11, 0x0D, 0x1D, 0x20, 0x21, 0x22, 0x23, 0x27, 0x2B, 0x2F, 0x40, 0x60, 0x70,
     0x80, 0x81, 0x82, 0x83, 0xA0, 0xA1, 0xA2, 0xA3, 0xA4, 0xC0, 0xC1, 0xC2, 0xC4, 0xC6, 0xD1, 0xDD,
     0xE0, 0xFF, 0x02, 0x03, 0x04, 0x7F]
)  # fmt: skip
"""First bytes of SDO requests: all valid ones, and some invalid ones."""

INDICES = np.array(
    [0x1000, 0x1001, 0x1003, 0x1005, 0x1006, 0x1008, 0x1014, 0x1016, 0x1017, 0x1018, 0x1019, 0x1021,
     0x1029, 0x1200, 0x1280, *range(0x1400, 0x1405), *range(0x1600, 0x1605), *range(0x1800, 0x1805),
     *range(0x1A00, 0x1A05), 0x1F50, 0x1F80, 0x2000, 0x5FFF, 0x6007, 0x603F, 0x6040, 0x6041, 0x605A,
     0x605B, 0x605C, 0x605D, 0x605E, 0x6060, 0x6061, 0x6064, 0x6065, 0x6066, 0x6067, 0x6068, 0x6072,
     0x6073, 0x607A, 0x607D, 0x607F, 0x6080, 0x6081, 0x6083, 0x6084, 0x6085, 0x6086, 0x608F, 0x60C5,
     0x60C6, 0x6502, 0x0005, 0xFFFF]
)  # fmt: skip

VALUES = np.array(
    [0, 1, 2, 4, 6, 7, 15, 0x1F, 0x3F, 0x7F, 0x80, 0x10F, 0x11F, 0xFF, 0x7FFF, 0x8000, 0xFFFF,
     0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF, 0x6040_0010, 0x607A_0020, 0x6041_0010, 0x8000_0201]
)  # fmt: skip


class Hostile:
    """Endless stream of frames.

    Parameters
    ----------
    seed : int
    session : sequence of can.Message
        Frames of a real session, source of damaged frames.
    """

    def __init__(self, seed: int, session: Sequence[can.Message]) -> None:
        self._rng = np.random.default_rng(seed)
        self._session_ids = np.array([frame.arbitration_id for frame in session])
        self._session_data = np.zeros((len(session), 8), np.uint8)
        for row, frame in zip(self._session_data, session, strict=True):
            row[: len(frame.data)] = frame.data
        self._session_sizes = np.array([len(frame.data) for frame in session])

    def __iter__(self) -> Iterator[can.Message]:
        while True:
            yield from self.batch(BATCH)

    def batch(self, n: int) -> list[can.Message]:
        """Draw `n` frames."""
        rng = self._rng
        makers = (
            self._noise,
            self._services,
            self._sdo,
            self._pdo,
            self._sync,
            self._nmt,
            self._spoilt,
        )
        kinds = rng.choice(len(makers), n, p=(0.12, 0.16, 0.32, 0.12, 0.05, 0.005, 0.225))
        ids, sizes = np.zeros(n, np.int64), np.zeros(n, np.int64)
        data = rng.integers(0, 256, (n, 8), np.uint8)
        for kind, make in enumerate(makers):
            at = np.flatnonzero(kinds == kind)
            ids[at], sizes[at] = make(at, data)
        marks = rng.choice(4, n, p=(0.94, 0.02, 0.03, 0.01))
        rows = zip(ids.tolist(), sizes.tolist(), data, marks.tolist(), strict=True)
        return [_frame(identifier, row[:size], mark) for identifier, size, row, mark in rows]

    def _nodes(self, n: int) -> NDArray[np.int64]:
        """Return node numbers, mostly ours, and often the first, so that transfers begin."""
        nodes = self._rng.choice([1, 1, 1, *NODES], n)
        strange = self._rng.random(n) < 0.05
        nodes[strange] = self._rng.integers(0, 128, strange.sum())
        return nodes

    def _sizes(self, n: int, usual: int) -> NDArray[np.int64]:
        odd = self._rng.random(n) < 0.08
        return np.where(odd, self._rng.integers(0, 9, n), usual)

    def _noise(self, at: NDArray[np.int64], data: NDArray[np.uint8]) -> tuple[object, object]:
        del data
        return self._rng.integers(0, 0x800, len(at)), self._rng.integers(0, 9, len(at))

    def _services(self, at: NDArray[np.int64], data: NDArray[np.uint8]) -> tuple[object, object]:
        del data
        services = self._rng.choice(SERVICES, len(at))
        services[services == 0] = 0x700  # frequent resets would switch everything off
        return services + self._nodes(len(at)), self._rng.integers(0, 9, len(at))

    def _sdo(self, at: NDArray[np.int64], data: NDArray[np.uint8]) -> tuple[object, object]:
        rng, n = self._rng, len(at)
        data[at, 0] = rng.choice(SPECIFIERS, n)
        index = rng.choice(INDICES, n)
        data[at, 1], data[at, 2] = index & 0xFF, index >> 8
        data[at, 3] = rng.choice([0, 0, 1, 1, 2, 3, 4, 5, 255], n)
        chosen = at[rng.random(n) < 0.7]
        values = rng.choice(VALUES, len(chosen)).astype("<u4")
        data[chosen, 4:] = values.view(np.uint8).reshape(-1, 4)
        return 0x600 + self._nodes(n), self._sizes(n, 8)

    def _pdo(self, at: NDArray[np.int64], data: NDArray[np.uint8]) -> tuple[object, object]:
        rng, n = self._rng, len(at)
        words = rng.choice([0x06, 0x07, 0x0F, 0x1F, 0x3F, 0x7F, 0x10F, 0x0B, 0x00, 0x80], n)
        commanding = rng.random(n) < 0.5
        data[at[commanding], 4] = words[commanding] & 0xFF
        data[at[commanding], 5] = words[commanding] >> 8
        return rng.choice([0x200, 0x200, 0x300, 0x400, 0x500], n) + self._nodes(n), self._sizes(
            n, 6
        )

    def _sync(self, at: NDArray[np.int64], data: NDArray[np.uint8]) -> tuple[object, object]:
        del data
        return np.full(len(at), 0x80), self._sizes(len(at), 0)

    def _nmt(self, at: NDArray[np.int64], data: NDArray[np.uint8]) -> tuple[object, object]:
        rng, n = self._rng, len(at)
        data[at, 0] = rng.choice([1, 1, 1, 2, 128, 129, 130, 0, 3, 127, 255], n)
        data[at, 1] = rng.choice([0, *NODES, *range(120, 128), 255], n)
        return np.zeros(n), self._sizes(n, 2)

    def _spoilt(self, at: NDArray[np.int64], data: NDArray[np.uint8]) -> tuple[object, object]:
        rng, n = self._rng, len(at)
        chosen = rng.integers(0, len(self._session_ids), n)
        data[at] = self._session_data[chosen]
        flip = at[rng.random(n) < 0.6]
        data[flip, rng.integers(0, 8, len(flip))] ^= 1 << rng.integers(0, 8, len(flip), np.uint8)
        sizes, ids = self._session_sizes[chosen].copy(), self._session_ids[chosen].copy()
        cut = rng.random(n) < 0.1
        sizes[cut] = rng.integers(0, 9, cut.sum())
        return ids, sizes


def _frame(identifier: int, data: NDArray[np.uint8], mark: int) -> can.Message:
    extended = mark == 2
    return can.Message(
        arbitration_id=identifier | (identifier << 18 if extended else 0),
        data=None if mark == 1 else data.tobytes(),
        dlc=len(data),
        is_remote_frame=mark == 1,
        is_extended_id=extended,
        is_error_frame=mark == 3,
    )


def plain(frame: can.Message) -> bool:
    """Return True if CANopen may accept a frame: a data frame of 11 bits."""
    return not (frame.is_remote_frame or frame.is_extended_id or frame.is_error_frame)
