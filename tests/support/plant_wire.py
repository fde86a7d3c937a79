"""Slaves of the plant on a wire within this process, without interface and root rights."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.ethercat.segment import Segment
    from sim_plant.faults.faulty_segment import FaultySegment


class PlantWire:
    """Wire from a master to slaves.

    Parameters
    ----------
    segment : Segment or FaultySegment

    Attributes
    ----------
    sent : int
        Number of sent frames.
    on_the_way : callable
        Function that changes a frame before it reaches the slaves; it returns None for a lost
        frame.
    on_the_way_back : callable
        Function that changes a frame after the slaves.
    """

    def __init__(self, segment: Segment | FaultySegment) -> None:
        self.segment = segment
        self.sent = 0
        self.on_the_way: Callable[[bytes], bytes | None] = bytes
        self.on_the_way_back: Callable[[bytes], bytes | None] = bytes
        self._back: deque[bytes] = deque()

    def send(self, frame: bytes | bytearray) -> bool:
        self.sent += 1
        out = self.on_the_way(bytes(frame))
        answer = None if out is None else self.segment.process(out)
        back = None if answer is None else self.on_the_way_back(answer)
        if back is not None:
            self._back.append(back)
        return True

    def receive(self, timeout: float) -> bytes | None:
        return self._back.popleft() if self._back else None

    def close(self) -> None:
        """Do nothing: no interface is open."""
