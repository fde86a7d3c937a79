"""Bus load and highest rate of SYNC.

The bus load is that of SYNC and every TPDO in answer, with worst-case bit stuffing. The TPDOs of a
drive are known after set-up: where its PDOs are fixed, the load is that of the fixed ones.

The rate of SYNC is bounded by the bus load and, on the wall clock, by the slowest answer and
the jitter of SYNC, measured on a bus with a stopwatch. An adapter may delay frames, so SYNC acts
later than it was sent. Only the drives see that delay; since their response times are constant, the
variation of their answers bounds the jitter.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import can
import numpy as np

from drivers.can_bus.capabilities import Capabilities, find_capabilities
from drivers.canopen.objects import SYNC
from drivers.canopen.pdo_mapping import answers, fed_forward, received, transmitted
from drivers.sync_clock import PAUSE, WINDOW

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from can.broadcastmanager import CyclicSendTaskABC

    from drivers.canopen.pdo_mapping import Pdo
    from drivers.drives_file import DrivesFile

ANSWERED = 0.99
"""Share of SYNCs answered within the time that determines the rate."""

MAX_LOAD = 0.7
"""Largest bus load; above, identifiers of low priority starve."""


def frame_bits(n_bytes: int) -> int:
    """Return the length of a data frame with worst-case bit stuffing [bits]."""
    return 47 + 8 * n_bytes + (33 + 8 * n_bytes) // 4


def cycle_time(
    drives: DrivesFile,
    sent: Sequence[Sequence[Pdo]] | None = None,
    *,
    streamed: bool = False,
    feed_forward: bool = False,
) -> float:
    """Return the time of SYNC and the frames of a cycle on the bus [s].

    Parameters
    ----------
    drives : DrivesFile
        Axes and bit rate.
    sent : sequence, optional
        TPDOs of each axis; by default the preferred ones.
    streamed : bool
        True if each axis also gets a set-point in every cycle.
    feed_forward : bool
        True if each axis also gets offsets of velocity and torque.
    """
    pdos = [transmitted(axis) for axis in drives.axes] if sent is None else sent
    sizes = [pdo.size for own in pdos for pdo in own]
    if streamed:
        sizes += [received(axis).size for axis in drives.axes]
    if feed_forward:
        sizes += [fed_forward(axis).size for axis in drives.axes]
    return time_on_bus(sizes, drives.bitrate)


def time_on_bus(sizes: Iterable[int], bitrate: int) -> float:
    """Return the time of SYNC and frames of these sizes [bytes] on the bus, at worst [s]."""
    return (frame_bits(0) + sum(map(frame_bits, sizes))) / bitrate


def cycle_on_bus(
    drives: DrivesFile | None, n_axes: int, bitrate: int, *, streamed: bool, feed_forward: bool
) -> tuple[float, str, float]:
    """Return the time of a cycle on the bus [s], its frames in words, and the largest bus load.

    Parameters
    ----------
    drives : DrivesFile or None
        None if unknown: one TPDO of 8 bytes for each axis is assumed.
    n_axes, bitrate : int
        Number of axes, and bit rate [bit/s].
    streamed, feed_forward : bool
        See `cycle_time`.
    """
    set_points = f" and {(1 + feed_forward) * n_axes} RPDOs" if streamed else ""
    if drives is None:
        sizes = [8] * n_axes * (2 if streamed else 1)
        frames = f"SYNC, {n_axes} TPDOs of 8 bytes{set_points} assumed without a drives file"
        return time_on_bus(sizes, bitrate), frames, MAX_LOAD
    drives = drives.model_copy(update={"bitrate": bitrate})
    count = sum(len(transmitted(axis)) for axis in drives.axes)
    frames = f"SYNC, {count} TPDOs{set_points} by the drives file"
    return cycle_time(drives, streamed=streamed, feed_forward=feed_forward), frames, MAX_LOAD


def achievable_rate(
    drives: DrivesFile, answer: float = 0.0, sent: Sequence[Sequence[Pdo]] | None = None
) -> float:
    """Return the highest rate of SYNC [1/s].

    Parameters
    ----------
    drives : DrivesFile
        Axes and bit rate.
    answer : float
        Response time of the slowest answer to a SYNC [s].
    sent : sequence, optional
        See `cycle_time`.
    """
    return 1 / max(cycle_time(drives, sent) / MAX_LOAD, answer / WINDOW)


class StopwatchBus(can.BusABC):
    """Bus that measures the response time of the answers to each SYNC.

    If the kernel sends SYNC, it is received like any frame, and time stamps are compared.

    Parameters
    ----------
    inner : can.BusABC
        Bus to measure; it stays open when this one is shut down.
    drives : DrivesFile
        Drives whose TPDOs are answers.
    clock : callable
        Clock [s].

    Attributes
    ----------
    sent : list of float
        Instants of the SYNCs [s].
    answers : list of float
        Time from each SYNC to the last TPDO in answer [s], 0 if none came.
    """

    def __init__(
        self, inner: can.BusABC, drives: DrivesFile, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self.sent: list[float] = []
        self.answers: list[float] = []
        self.channel_info = inner.channel_info
        self._inner, self._clock = inner, clock
        self._expected = {cob_id for axis in drives.axes for cob_id in answers(axis)}
        self._by_kernel = False
        super().__init__("stopwatch")

    @property
    def slowest(self) -> float:
        """Quantile `ANSWERED` of the response times to SYNC [s]."""
        return float(np.quantile(self.answers, ANSWERED))

    def jitter(self, period: float) -> float:
        """Return the quantile `ANSWERED` of SYNC's deviation from its period at the drives [s].

        The deviation at sending and the variation of the response time are added.
        """
        sent, answers = np.array(self.sent), np.array(self.answers)
        gaps = np.diff(sent)[(answers[:-1] > 0) & (answers[1:] > 0)]
        took = answers[answers > 0]
        if not gaps.size:
            return 0.0
        off = np.quantile(np.abs(gaps[gaps < PAUSE] - period), ANSWERED)
        return float(off + np.quantile(took, ANSWERED) - took.min())

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of the inner bus except blocks, whose frames could not be timed."""
        return replace(find_capabilities(self._inner), blocks=None)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame."""
        if msg.arbitration_id == SYNC:
            self._begin(self._clock())
        self._inner.send(msg, timeout)

    def send_periodic(
        self, msgs: can.Message | Sequence[can.Message], period: float, *args: Any, **kwargs: Any
    ) -> CyclicSendTaskABC:
        """Let the inner bus send frames periodically; SYNC is then sent by the kernel."""
        self._by_kernel = self.capabilities.kernel_sync
        return self._inner.send_periodic(msgs, period, *args, **kwargs)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Receive a frame, and note an answer to SYNC."""
        frame = self._inner.recv(timeout)
        if frame is None:
            return None
        if self._by_kernel and frame.arbitration_id == SYNC and not frame.is_rx:
            self._begin(frame.timestamp)
        elif self.sent and frame.arbitration_id in self._expected:
            now = frame.timestamp if self._by_kernel else self._clock()
            self.answers[-1] = now - self.sent[-1]
        return frame

    def _begin(self, instant: float) -> None:
        self.sent.append(instant)
        self.answers.append(0.0)

    def _recv_internal(self, timeout: float | None) -> tuple[Any, bool]:
        return self._inner.recv(timeout), True
