"""Objects written to drives, decoded from the frames on their bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import can

Place = tuple[int, int, int]
"""Node, index, sub-index."""


def downloads(frames: list[can.Message]) -> list[Place]:
    """Return objects written by expedited SDO downloads, except refused ones."""
    refused = [_place(frame) for frame in frames if _answer(frame) and frame.data[0] == 0x80]
    return [
        _place(frame)
        for frame in frames
        if 0x600 < frame.arbitration_id < 0x680 and frame.data[0] >> 5 == 1
        if _place(frame) not in refused
    ]


def _answer(frame: can.Message) -> bool:
    return 0x580 < frame.arbitration_id < 0x600


def _place(frame: can.Message) -> Place:
    return frame.arbitration_id & 0x7F, int.from_bytes(frame.data[1:3], "little"), frame.data[3]
