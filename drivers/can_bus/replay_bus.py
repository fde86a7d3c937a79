"""A log of frames as a bus: ``can.Bus(interface="replay", channel="run.asc")``.

A driver that does what it did when the log was written gets the same answers. Each frame that it
sends is compared with the log; what had been received by then, and up to the next sent one, is
handed out. Where the two part, an error names the frame: another plan, other drives file or another
version of the program. Heartbeats of the master go by the clock, show nothing and are passed over.

A log of lock-step is replayed in lock-step. In one of a real bus time is the log's too: it jumps to
the instant of each frame, and waiting without a frame takes just as long as was asked for. So SYNCs
have the instants they had, and a telegram that came too late comes too late again.
"""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import can

from drivers.can_bus.replay_log import SYNC, ReplayLog, is_heartbeat
from drivers.drive_bus import BusUnavailable

if TYPE_CHECKING:
    from can.typechecking import CanFilters, Channel

TICK = 1e-6
"""Even asking without waiting takes some time, so that every wait ends [s]."""


class ReplayBus(can.BusABC):
    """A recorded session.

    Parameters
    ----------
    channel : str
        Path of the log.
    can_filters : optional
        As everywhere in python-can.
    lock_step : bool, optional
        Whether time is counted in SYNCs; by default the log shows it.
    bitrate : int, optional
        Without meaning here.

    Attributes
    ----------
    lock_step : bool

    Raises
    ------
    can.CanInitializationError
        The log cannot be read.
    """

    def __init__(
        self,
        channel: Channel,
        can_filters: CanFilters | None = None,
        *,
        lock_step: bool | None = None,
        bitrate: int | None = None,
    ) -> None:
        del bitrate
        self._path = Path(str(channel))
        self._log = ReplayLog(self._path)
        self.lock_step = self._log.lock_step if lock_step is None else lock_step
        self.channel_info = f"replay of {channel}"
        self._frames = iter(self._log)
        self._now = 0.0
        self._number = 0
        self._next: can.Message | None = None
        self._last: can.Message | None = None
        self._received: deque[can.Message] = deque()
        self._over = False
        self._read_on()
        super().__init__(channel, can_filters)

    def clock(self) -> float:
        """Time since the log's first frame [s]."""
        return self._now

    def until_next_sent(self) -> float:
        """How long until the next frame was sent [s], at least 0."""
        return max(0.0, self._instant(self._next) - self._now) if self._next else 0.0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        """Compare a frame with the one that was sent then.

        Raises
        ------
        BusUnavailable
            The log has another frame here or none any more; raised once, then frames are ignored.
        """
        if self._over or is_heartbeat(msg):
            return
        if self._next is None:
            self._end(f"before {_shown(msg)} was sent")
        if _shown(msg) != _shown(self._next):
            self._over, self._last = True, None
            self._received.clear()
            raise BusUnavailable(
                f"{self._path}: frame {self._number}: the log has {_shown(self._next)}, now"
                f" {_shown(msg)} is sent; replay with the plan, robot, drives file, options and"
                " version that the log was made with"
            )
        self._now = self._instant(self._next)
        self._last = self._next
        self._read_on()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Hand out the next frame if it was received by now or comes within `timeout` [s].

        Raises
        ------
        BusUnavailable
            The log breaks off here; raised once.
        """
        ends = math.inf if timeout is None or self.lock_step else self._now + timeout
        while self._received and self._instant(self._received[0]) <= ends:
            frame = self._received.popleft()
            self._now = max(self._now, self._instant(frame))
            if self._matches_filters(frame):
                return frame
        last = self._last
        if not self._received and self._next is None and last and last.arbitration_id == SYNC:
            self._end("in the middle of a session")
        self._now += max(timeout or 0.0, TICK)
        return None

    def _read_on(self) -> None:
        """Go on to the next sent frame; what was received before it may be handed out."""
        self._next = None
        for number, frame, sent in self._frames:
            self._number = number
            if not sent:
                self._received.append(frame)
            elif not is_heartbeat(frame):
                self._next = frame
                return

    def _instant(self, frame: can.Message) -> float:
        return round(frame.timestamp - self._log.begin, 6)

    def _end(self, where: str) -> NoReturn:
        self._over, self._last = True, None
        raise BusUnavailable(
            f"{self._path}: ends after frame {self._number} {self._log.damage}, {where}; what was"
            " measured up to here is complete"
        )

    def _apply_filters(self, filters: CanFilters | None) -> None:
        pass


def _shown(frame: can.Message) -> str:
    """Write a frame as candump does: all that has to agree."""
    identifier = f"{frame.arbitration_id:0{8 if frame.is_extended_id else 3}X}"
    return f"{identifier}#{'R' if frame.is_remote_frame else frame.data.hex().upper()}"
