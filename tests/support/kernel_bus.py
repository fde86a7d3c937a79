"""Bus whose kernel sends SYNC, with drives in lock-step: an equivalent of socketcan."""

from __future__ import annotations

import time
from typing import Any

import can
from can.interfaces.socketcan import SocketcanBus


class _Task:
    def __init__(self, bus: SocketcanLike) -> None:
        self._bus = bus

    def stop(self) -> None:
        self._bus.period = None


class SocketcanLike(SocketcanBus):
    """Bus that sends a periodic frame at its deadlines, and returns each frame with a time stamp.

    Attributes
    ----------
    period : float or None
        Period of the periodic frame [s].
    by_kernel, by_us : int
        Numbers of SYNCs sent by the kernel, and by `send`.
    """

    def __init__(self, inner: can.BusABC) -> None:
        self.period: float | None = None
        self.by_kernel = self.by_us = 0
        self.channel_info = "socketcan channel 'can9'"
        self._inner = inner
        self._due = 0.0
        self._periodic_tasks: list[Any] = []
        self._is_shutdown = False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.by_us += msg.arbitration_id == 0x80
        self._inner.send(msg, timeout)

    def send_periodic(  # type: ignore[override]
        self, msgs: can.Message, period: float, *args: Any, **kwargs: Any
    ) -> _Task:
        self._frame, self.period, self._due = msgs, period, time.time() + period
        return _Task(self)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        frame = self._inner.recv(0.0)
        if frame is not None:
            frame.timestamp = time.time()
            return frame
        ends = time.time() + (timeout or 0.0)
        if self.period is None or self._due > ends:
            time.sleep(max(0.0, ends - time.time()))
            return None
        time.sleep(max(0.0, self._due - time.time()))
        return self._synced(self.period)

    def _synced(self, period: float) -> can.Message:
        self.by_kernel += 1
        instant, self._due = self._due, self._due + period
        self._inner.send(self._frame)
        return can.Message(
            arbitration_id=0x80, is_extended_id=False, is_rx=False, timestamp=instant
        )

    def _apply_filters(self, filters: Any) -> None:
        self._inner.set_filters(filters)

    def shutdown(self) -> None:
        self._is_shutdown = True
        self._inner.shutdown()
