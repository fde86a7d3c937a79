"""Reader of frame logs: frames in order, their sender, and the kind of time.

Formats differ in content. Where none of the first frames is marked as sent (.csv, .db, or a log of
`candump`), the predefined connection set (CiA 301) identifies the sender: NMT, SYNC, RPDOs and SDO
requests are the master's, and so is the heartbeat of a node that answers no SDO. In lock-step the
plant's time does not advance while the master sends; a log with this property is one of lock-step.
"""

from __future__ import annotations

from itertools import islice, pairwise
from typing import TYPE_CHECKING

import can

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

HEAD = 5000
"""Number of first frames that classify a log: setting up the drives alone takes hundreds."""

SYNC = 0x80
_MASTERS = frozenset({0x200, 0x300, 0x400, 0x500, 0x600})
_HEARTBEAT = 0x700


def is_heartbeat(frame: can.Message) -> bool:
    """Return True if a frame is a heartbeat or boot-up message."""
    return frame.arbitration_id & ~0x7F == _HEARTBEAT and not frame.is_extended_id


class ReplayLog:
    """Frames of a log.

    Parameters
    ----------
    path : Path
        Log in any format that python-can reads.

    Attributes
    ----------
    lock_step : bool
        True if time does not advance while frames are sent.
    begin : float
        Time stamp of the first frame [s].
    damage : str
        Reason why reading ended before the end of the file; empty if none.

    Raises
    ------
    can.CanInitializationError
        No such file, an unknown format, or no frame.
    """

    def __init__(self, path: Path) -> None:
        self.damage = ""
        self._path = path
        head = list(islice(self._frames(), HEAD))
        if not head:
            raise can.CanInitializationError(
                f"{path}: holds no frames {self.damage or 'at all'}; give a log that hil run"
                " --frame-log wrote"
            )
        self._marked = not all(frame.is_rx for frame in head)
        answering = {f.arbitration_id - 0x580 for f in head if f.arbitration_id & ~0x7F == 0x580}
        self._slaves = {_HEARTBEAT + node for node in answering}
        self.begin = head[0].timestamp
        steps = [b.timestamp - a.timestamp for a, b in pairwise(head) if self._is_sent(b)]
        self.lock_step = bool(steps) and max(map(abs, steps)) < 1e-6

    def __iter__(self) -> Iterator[tuple[int, can.Message, bool]]:
        """Iterate over number from 1, frame, and True for frames of the master."""
        for number, frame in enumerate(self._frames(), start=1):
            yield number, frame, self._is_sent(frame)

    def _is_sent(self, frame: can.Message) -> bool:
        if self._marked:
            return not frame.is_rx
        identifier = frame.arbitration_id
        if frame.is_extended_id or frame.is_error_frame:
            return False
        if identifier & ~0x7F == _HEARTBEAT:
            return identifier not in self._slaves
        return identifier in {0x000, 0x080} or identifier & ~0x7F in _MASTERS

    def _frames(self) -> Iterator[can.Message]:
        try:
            with can.LogReader(self._path) as reader:
                yield from reader
        except Exception as error:  # each format raises its own for damaged places
            self.damage = f"({error or type(error).__name__})"
