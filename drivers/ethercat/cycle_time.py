"""How long a cycle takes: on the cable, and as it was measured."""

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
"""Of EtherCAT [bit/s]."""
MAX_LOAD = 0.7
"""Share of the period that a frame may take: mailboxes need the rest."""
HOP = 1e-6
"""Time that a frame takes through one slave, there and back, and its cables [s]."""
_ETHERNET = 24
"""Preamble, check sum and gap of a frame [bytes]."""
ANSWERED = 0.99
"""Share of the frames that the slowest answer is taken of."""
RESERVE = 2.0
"""Times the slowest answer that a period is to have: the computer itself takes as long."""
_COMMAND = 16
"""Where the command of the first datagram stands in a frame."""


def cycle_time(drives: DrivesFile, *, feed_forward: bool = False) -> float:
    """Return how long a frame with the process data of all axes takes [s]."""
    entries = [(*outputs_of(feed_forward=feed_forward), *inputs_of(axis)) for axis in drives.axes]
    sizes = [sum(entry.word & 0xFF for entry in own) // 8 + 1 for own in entries]
    sizes += [2, TIME_SIZE, DIFFERENCE_SIZE]
    size = START + sum(HEAD + each + TAIL for each in sizes) + _ETHERNET
    return 8 * size / BITRATE + HOP * len(drives.axes)


class StopwatchWire:
    """A wire that notes when frames with process data were sent and came back.

    Parameters
    ----------
    inner : Wire
        That it stands for; closing this one leaves that one open.
    clock : callable
        [s].
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
        """Time in which nearly all frames came back [s]."""
        return float(np.quantile(self._took, ANSWERED)) if self._took else 0.0

    def achievable_rate(self, slowest: float) -> float:
        """Return the highest rate of cycles that leaves room [1/s], by the slowest answer [s]."""
        took = slowest or float(np.median(self._took or [0.0]))
        return 1 / (RESERVE * took) if took else 0.0

    def jitter(self, period: float) -> float:
        """Return how far nearly all frames were off their period when they were sent [s]."""
        gaps = np.diff(self._sent)
        gaps = gaps[gaps < 2 * period]
        return float(np.quantile(np.abs(gaps - period), ANSWERED)) if gaps.size else 0.0
