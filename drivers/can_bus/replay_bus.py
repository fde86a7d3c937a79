"""Frame log as a bus: ``can.Bus(interface="replay", channel="run.asc")``.

A driver that repeats its actions gets the same answers. Each sent frame is compared with the log;
frames received before it, and up to the next sent one, are delivered. At a difference an error
names the frame: another plan, other drives file or another version of the program. Heartbeats of
the master depend on the clock, carry no information and are skipped.

A log of lock-step is replayed in lock-step. For a real bus, time is that of the log: it jumps to
the instant of each frame, and waiting without a frame takes exactly the timeout. Hence SYNCs keep
their instants, and a late telegram is late again.

Log formats differ in content. Where none of the first frames is marked as sent (.csv, .db, or a log
of `candump`), the predefined connection set (CiA 301) identifies the sender: NMT, SYNC, RPDOs and
SDO requests are the master's, and so is the heartbeat of a node that answers no SDO. In lock-step
the plant's time does not advance while the master sends; a log with this property is one of
lock-step.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import islice, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import can

from drivers.drive_bus import BusUnavailable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from can.typechecking import CanFilters, Channel

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
                f"{path}: holds no frames {self.damage or 'at all'}; give a log of hil run "
                "--frame-log"
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
        except Exception as error:  # each format raises its own errors for damaged places
            self.damage = f"({error or type(error).__name__})"


TICK = 1e-6
"""Time taken by a poll without waiting, so that every wait ends [s]."""


class ReplayBus(can.BusABC):
    """A recorded session.

    Parameters
    ----------
    channel : str
        Path of the log.
    can_filters : optional
        As in python-can.
    lock_step : bool, optional
        True if time is counted in SYNCs; by default found from the log.
    bitrate : int, optional
        Ignored.

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
        """Return the time since the log's first frame [s]."""
        return self._now

    def until_next_sent(self) -> float:
        """Return the time until the next frame was sent [s], at least 0."""
        return max(0.0, self._instant(self._next) - self._now) if self._next else 0.0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        """Compare a frame with the sent frame in the log.

        Raises
        ------
        BusUnavailable
            The log has another frame or none; raised once, then frames are ignored.
        """
        if self._over or is_heartbeat(msg):
            return
        if self._next is None:
            self._end(f"before {_format_frame(msg)} was sent")
        if _format_frame(msg) != _format_frame(self._next):
            self._over, self._last = True, None
            self._received.clear()
            raise BusUnavailable(
                f"{self._path}: frame {self._number}: the log has {_format_frame(self._next)}, now"
                f" {_format_frame(msg)} is sent; replay with the plan, robot, drives file, options"
                " and version that the log was made with"
            )
        self._now = self._instant(self._next)
        self._last = self._next
        self._read_on()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Deliver the next frame if received by now or within `timeout` [s].

        Raises
        ------
        BusUnavailable
            The log ends here; raised once.
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
        """Advance to the next sent frame; frames received before it may then be delivered."""
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
            f"{self._path}: ends after frame {self._number} {self._log.damage}, {where}; "
            "measurements up to here are complete"
        )

    def _apply_filters(self, filters: CanFilters | None) -> None:
        pass


def _format_frame(frame: can.Message) -> str:
    """Format a frame like candump: identifier, type and data."""
    identifier = f"{frame.arbitration_id:0{8 if frame.is_extended_id else 3}X}"
    return f"{identifier}#{'R' if frame.is_remote_frame else frame.data.hex().upper()}"
