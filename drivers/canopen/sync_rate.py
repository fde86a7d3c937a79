"""How often the drives can be asked.

The rate of SYNC is bounded by the load of the bus (`bus_load`) and, on the wall clock, by how long
the slowest answer takes and how far SYNC is off its period, which a bus with a stopwatch finds out.
An adapter hands frames on when it likes, so SYNC acts at another instant than it was sent. Nobody
but the drives sees that; as they answer each alike, their answers vary by no less.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import can
import numpy as np

from drivers.can_bus.capabilities import Capabilities, capabilities_of
from drivers.canopen.bus_load import MAX_LOAD, cycle_time
from drivers.canopen.objects import SYNC
from drivers.canopen.pdo_mapping import answers
from drivers.sync_clock import PAUSE, WINDOW

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from can.broadcastmanager import CyclicSendTaskABC

    from drivers.canopen.pdo_mapping import Pdo
    from drivers.drives_file import DrivesFile

ANSWERED = 0.99
"""Share of the SYNCs that must be answered in the time that a rate is computed from."""


def achievable_rate(
    drives: DrivesFile, answer: float = 0.0, sent: Sequence[Sequence[Pdo]] | None = None
) -> float:
    """Return the highest rate of SYNC [1/s].

    Parameters
    ----------
    drives : DrivesFile
        Axes and bit rate.
    answer : float
        How long the slowest answer to a SYNC takes [s].
    sent : sequence, optional
        See `cycle_time`.
    """
    return 1 / max(cycle_time(drives, sent) / MAX_LOAD, answer / WINDOW)


class StopwatchBus(can.BusABC):
    """A bus that notes how long the answers to each SYNC take, whoever sends it.

    Where the kernel does, SYNC is heard like any frame, and time stamps are compared.

    Parameters
    ----------
    inner : can.BusABC
        The bus that it stands for; shutting this one down leaves that one open.
    drives : DrivesFile
        Whose TPDOs are answers.
    clock : callable
        [s].

    Attributes
    ----------
    sent : list of float
        When each SYNC was sent [s].
    answers : list of float
        From each SYNC to the last TPDO that followed it [s], 0 where none did.
    """

    def __init__(
        self,
        inner: can.BusABC,
        drives: DrivesFile,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.sent: list[float] = []
        self.answers: list[float] = []
        self.channel_info = inner.channel_info
        self._inner = inner
        self._clock = clock
        self._expected = {cob_id for axis in drives.axes for cob_id in answers(axis)}
        self._by_kernel = False
        super().__init__("stopwatch")

    @property
    def slowest(self) -> float:
        """Time in which `ANSWERED` of the SYNCs were answered [s]."""
        return float(np.quantile(self.answers, ANSWERED))

    def jitter(self, period: float) -> float:
        """Return how far SYNCs were off their period where they act, by `ANSWERED` of them [s].

        That is how far they were off when they were sent, and by how much answers to them vary.
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
        """All of the inner bus's but blocks, whose frames would not be noted."""
        return replace(capabilities_of(self._inner), blocks=None)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame."""
        if msg.arbitration_id == SYNC:
            self._begin(self._clock())
        self._inner.send(msg, timeout)

    def send_periodic(
        self, msgs: can.Message | Sequence[can.Message], period: float, *args: Any, **kwargs: Any
    ) -> CyclicSendTaskABC:
        """Let the inner bus send frames periodically; SYNC is the kernel's from now on."""
        self._by_kernel = self.capabilities.kernel_sync
        return self._inner.send_periodic(msgs, period, *args, **kwargs)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Receive a frame; an answer to SYNC is noted."""
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
