"""Duration of a cycle: computed for the cable, and measured."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from drivers.ethercat.clocks import DIFFERENCE_SIZE, TIME_SIZE
from drivers.ethercat.frames import HEAD, START, TAIL, Command
from drivers.ethercat.process_layout import inputs_of, outputs_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drives_file import DrivesFile
    from drivers.ethercat.wire import Wire

BITRATE = 100_000_000
"""Bit rate of EtherCAT [bit/s]."""
MAX_LOAD = 0.7
"""Largest share of the period for a frame: mailboxes need the rest."""
HOP = 1e-6
"""Time of a frame through one slave, both ways, and its cables [s]."""
_ETHERNET = 24
"""Preamble, check sum and gap of a frame [bytes]."""
ANSWERED = 0.99
"""Share of frames for the slowest answer."""
RESERVE = 2.0
"""Period as a multiple of the slowest answer: the computer itself takes as long."""
_COMMAND = 16
"""Offset of the command of the first datagram in a frame."""


def cycle_time(drives: DrivesFile, *, feed_forward: bool = False) -> float:
    """Return the duration of a frame with the process data of the axes [s]."""
    entries = [(*outputs_of(feed_forward=feed_forward), *inputs_of(axis)) for axis in drives.axes]
    sizes = [sum(entry.word & 0xFF for entry in own) // 8 + 1 for own in entries]
    sizes += [2, TIME_SIZE, DIFFERENCE_SIZE]
    size = START + sum(HEAD + each + TAIL for each in sizes) + _ETHERNET
    return 8 * size / BITRATE + HOP * len(drives.axes)


class StopwatchWire:
    """Wire that measures the return times of frames with process data.

    Parameters
    ----------
    inner : Wire
        Wire to measure; it stays open when this one is closed.
    clock : callable
        Clock [s].
    """

    def __init__(self, inner: Wire, clock: Callable[[], float] = time.perf_counter) -> None:
        self._inner, self._clock = inner, clock
        self._sent: list[float] = []
        self._took: list[float] = []
        self._cyclic = False

    def send(self, frame: bytes | bytearray) -> bool:
        """Send a frame."""
        self._cyclic = frame[_COMMAND] == Command.LRW
        if self._cyclic:
            self._sent.append(self._clock())
        return self._inner.send(frame)

    def receive(self, timeout: float) -> bytes | None:
        """Return the next frame."""
        frame = self._inner.receive(timeout)
        if frame is not None and self._cyclic:
            self._took.append(self._clock() - self._sent[-1])
        return frame

    def close(self) -> None:
        """Leave the wire open."""

    @property
    def slowest(self) -> float:
        """Return time of `ANSWERED` of the frames [s]."""
        return float(np.quantile(self._took, ANSWERED)) if self._took else 0.0

    def achievable_rate(self, slowest: float) -> float:
        """Return the highest rate of cycles with a reserve [1/s], for the slowest answer [s]."""
        took = slowest or float(np.median(self._took or [0.0]))
        return 1 / (RESERVE * took) if took else 0.0

    def jitter(self, period: float) -> float:
        """Return the deviation of frames from their period at sending, for `ANSWERED` [s]."""
        gaps = np.diff(self._sent)
        gaps = gaps[gaps < 2 * period]
        return float(np.quantile(np.abs(gaps - period), ANSWERED)) if gaps.size else 0.0
