"""canopen's network without threads: the waiting caller pumps the frames.

canopen delivers frames from a notifier thread, and its clients block on queues filled by that
thread. Here every wait pumps: `PumpedNetwork.pump` receives frames and dispatches them to canopen's
own subscribers, and `drivers.canopen.sdo.PumpedSdoClient` pumps until its answer arrives. Hence
there are no races and no dead-locks, and on a bus in lock-step time does not advance while a client
waits.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import can
from canopen import Network

from checked_files.yaml_file import FileError
from drivers.can_bus.capabilities import find_capabilities
from drivers.drive_bus import BusUnavailable, DriveError

if TYPE_CHECKING:
    from collections.abc import Callable

SEND_ATTEMPTS = 10
"""Largest number of attempts: a full queue (socketcan: 10 frames) drains within milliseconds."""

SEND_BACK_OFF = 0.001
"""Time between two attempts to send [s]."""

BABBLE = 0.25
"""Longest time for emptying a queue after the end of a wait [s]."""


class PumpedNetwork(Network):
    """CANopen network with reception by `pump`, in the caller's thread.

    Parameters
    ----------
    bus : can.BusABC
        An open bus.
    synchronous : bool
        True if answers are queued before the bus's ``send`` returns: an empty queue ends any wait.

    Attributes
    ----------
    attempts : int
        Largest number of attempts to send a frame.
    """

    def __init__(self, bus: can.BusABC, *, synchronous: bool) -> None:
        super().__init__(bus)
        self.channel, self.synchronous = bus, synchronous
        self.attempts = SEND_ATTEMPTS
        self._clock = find_capabilities(bus).clock
        self.idle: Callable[[], None] = lambda: None
        """Called before every reception while waiting, to keep our heartbeat going."""

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame, repeatedly if the transmit queue is full.

        Raises
        ------
        BusUnavailable
            The bus does not accept the frame.
        """
        self.send_frame(
            can.Message(
                arbitration_id=can_id, data=data, is_remote_frame=remote, is_extended_id=False
            )
        )

    def send_frame(self, frame: can.Message) -> None:
        """Send a prepared frame (see `send_message`)."""
        try:
            self.channel.send(frame)
        except Exception as error:
            self.send_again(frame, error)

    def send_again(self, frame: can.Message, error: Exception) -> None:
        """Repeat a frame refused by the bus with `error` (see `send_message`)."""
        for _ in range(1, self.attempts):
            if isinstance(error, DriveError):
                raise error
            time.sleep(SEND_BACK_OFF)
            try:
                return self.channel.send(frame)
            except Exception as again:
                error = again
        raise self.unavailable(f"frame {frame.arbitration_id:03X} cannot be sent", error)

    def unavailable(self, what: str, error: Exception) -> DriveError:
        """Convert an exception of the bus, of any type, to a `DriveError`."""
        if isinstance(error, DriveError):
            return error
        words = (
            f"{self.channel.channel_info}: {what}: {error or type(error).__name__}; check cable, "
            "termination and that the interface is up"
        )
        unavailable = BusUnavailable(str(error) if isinstance(error, FileError) else words)
        unavailable.__cause__ = error
        return unavailable

    def receive(self, timeout: float) -> can.Message | None:
        """Receive a frame, or return None after `timeout` [s].

        Raises
        ------
        BusUnavailable
            The bus has gone.
        """
        try:
            return self.channel.recv(timeout)
        except Exception as error:
            raise self.unavailable("cannot receive", error) from error

    def dispatch(self, frame: can.Message) -> None:
        """Deliver a received frame to its subscribers."""
        if not (frame.is_error_frame or frame.is_remote_frame or frame.is_extended_id):
            self.notify(frame.arbitration_id, frame.data, frame.timestamp)

    def pump(self, timeout: float, until: Callable[[], bool] | None = None) -> bool:
        """Receive and dispatch frames for `timeout` [s], or until `until` is true.

        Returns
        -------
        bool
            The last result of `until`.
        """
        ends = self._clock() + timeout
        while True:
            self.idle()
            if until is not None and until():
                return True
            left = max(0.0, ends - self._clock())
            frame = self.receive(0.0 if self.synchronous else min(left, 0.02))
            empty = frame is None
            if frame is not None:
                self.dispatch(frame)
            if self.synchronous:
                over = empty
            else:  # a faulty node may send without end
                over = left == 0.0 and (empty or self._clock() > ends + BABBLE)
            if over:
                return until is not None and until()
