"""Bus with a stopwatch for the answers to SYNC and the jitter of SYNC.

An adapter may delay frames, so SYNC acts later than it was sent. Only the drives see that delay;
since their response times are constant, the variation of their answers bounds the jitter.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import can
import numpy as np

from drivers.can_bus.capabilities import Capabilities, find_capabilities
from drivers.canopen.objects import SYNC
from drivers.canopen.pdo_mapping import answers
from drivers.sync_clock import PAUSE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.drives_file import DrivesFile

ANSWERED = 0.99
"""Share of SYNCs answered within the time that determines the rate."""


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
    ) -> Any:
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
