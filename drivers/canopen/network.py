"""canopen's network without threads: frames are pumped by whoever waits for one.

canopen hands frames over from a notifier thread, and its clients block on queues which that thread
fills. Here nobody waits without pumping: `PumpedNetwork.pump` receives frames and dispatches them
to canopen's own subscribers, and `drivers.canopen.sdo.PumpedSdoClient` pumps until its answer is
there. So there are no races and no dead-locks, and on a bus in lock-step time stands still while a
client waits.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import can
from canopen import Network

from checked_files.yaml_file import FileError
from drivers.can_bus.capabilities import capabilities_of
from drivers.drive_bus import BusUnavailable, DriveError

if TYPE_CHECKING:
    from collections.abc import Callable

SEND_ATTEMPTS = 10
"""A full transmit queue (socketcan: 10 frames) drains within milliseconds."""

SEND_BACK_OFF = 0.001
"""Time between two attempts to send [s]."""

BABBLE = 0.25
"""How long a queue may take to be read empty once the time of a wait is up [s]."""


class PumpedNetwork(Network):
    """A network whose frames are received by `pump`, in the caller's thread.

    Parameters
    ----------
    bus : can.BusABC
        An open bus.
    synchronous : bool
        All answers are queued before the bus's ``send`` returns: an empty queue ends any wait.

    Attributes
    ----------
    attempts : int
        How often a frame is sent that the bus does not take at once.
    """

    def __init__(self, bus: can.BusABC, *, synchronous: bool) -> None:
        super().__init__(bus)
        self.channel = bus
        self.synchronous = synchronous
        self.attempts = SEND_ATTEMPTS
        self._clock = capabilities_of(bus).clock
        self.idle: Callable[[], None] = lambda: None
        """Called before every reception while waiting, to keep our heartbeat going."""

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send one frame, again if the transmit queue is full.

        Raises
        ------
        BusUnavailable
            The bus does not take the frame.
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
        """Send a frame that the bus did not take, for `error` (see `send_message`)."""
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
        """Return an error of the bus as one of ours, whatever its back end raised."""
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
        """Receive one frame or None [timeout in s].

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
        """Hand one received frame to its subscribers."""
        if not (frame.is_error_frame or frame.is_remote_frame or frame.is_extended_id):
            self.notify(frame.arbitration_id, frame.data, frame.timestamp)

    def pump(self, timeout: float, until: Callable[[], bool] | None = None) -> bool:
        """Receive and dispatch frames for `timeout` [s], or until `until` holds.

        Returns
        -------
        bool
            Whether `until` holds.
        """
        ends = self._clock() + timeout
        while True:
            self.idle()
            if until is not None and until():
                return True
            left = max(0.0, ends - self._clock())
            frame = self.receive(0.0 if self.synchronous else min(left, 0.02))
            if frame is not None:
                self.dispatch(frame)
            if self._over(left, ends, empty=frame is None):
                return until is not None and until()

    def _over(self, left: float, ends: float, *, empty: bool) -> bool:
        """Whether waiting is over: nothing more to read, or a node that never falls silent."""
        if self.synchronous:
            return empty
        return left == 0.0 and (empty or self._clock() > ends + BABBLE)
