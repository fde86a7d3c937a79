"""canopen's network without threads: frames are pumped by whoever waits for one.

canopen hands frames over from a notifier thread, and its clients block on queues which that thread
fills. Here nobody waits without pumping: `PumpedNetwork.pump` receives frames and dispatches them
to canopen's own subscribers, and `PumpedSdoClient` pumps until its answer is there. So there are no
races and no dead-locks, and on a bus in lock-step time stands still while a client waits.
"""

from __future__ import annotations

import struct
import time
from typing import TYPE_CHECKING

import can
from canopen import Network, ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

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

_ABORTED = 0x80
_SDO_SIZE = 8
_SIZE_INDICATION = 0xE3
_SIZE_LEFT_OPEN = 0x42
"""Bits of an answer that make it an expedited upload (command 2, e = 1) without size (s = 0)."""
_EXPEDITED = 0x23
"""A request to write (command 1), its data in the frame (e = 1) and their size stated (s = 1)."""
_INITIATING = frozenset({1, 2})
"""Command specifiers of requests whose answer repeats index and sub-index."""


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
        self.idle: Callable[[], None] = _nothing
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
        unavailable = BusUnavailable(
            f"{self.channel.channel_info}: {what}: {error or type(error).__name__}; check cable, "
            "termination and that the interface is up"
        )
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


class PumpedSdoClient(SdoClient):
    """canopen's SDO client, waiting by pumping its network.

    Parameters
    ----------
    network : PumpedNetwork
        The network, pumped while the client waits.
    node : int
        Whose default SDO server is asked.
    timeout : float
        How long an answer may take [s].
    """

    def __init__(self, network: PumpedNetwork, node: int, timeout: float) -> None:
        dictionary = ObjectDictionary()  # type: ignore[no-untyped-call]
        super().__init__(0x600 + node, 0x580 + node, dictionary)  # type: ignore[no-untyped-call]
        self.network = network
        self._pumped = network
        self._timeout = timeout
        self._answers: list[bytes] = []
        self._object: bytes | None = None
        self._size_left_open = False
        network.subscribe(self.tx_cobid, self.on_response)

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Take an answer from the network, unless it is none to what was asked."""
        del can_id, timestamp
        if len(data) == _SDO_SIZE and self._object in (None, data[1:4]):
            self._answers.append(bytes(data))

    def upload_number(self, index: int, subindex: int, size: int) -> bytes:
        """Read an object whose length is `size` [bytes].

        A server may leave it open how many of the four bytes of an expedited answer count (CiA
        301: size indicator 0); then those of the object do. Any other length is returned as it is.
        """
        data: bytes = self.upload(index, subindex)
        return data[:size] if self._size_left_open else data

    def request_response(self, sdo_request: bytes) -> bytes:
        """Send a request and wait for its answer; answers to earlier requests are dropped."""
        self._pumped.pump(0.0)
        self._answers.clear()
        names_object = sdo_request[0] >> 5 in _INITIATING
        self._object = bytes(sdo_request[1:4]) if names_object else None
        self.send_request(sdo_request)  # type: ignore[no-untyped-call]
        return self.read_response()

    def read_response(self) -> bytes:
        """Wait for one answer.

        Raises
        ------
        canopen.SdoAbortedError, canopen.SdoCommunicationError
            The server refuses; it does not answer in time.
        """
        if not self._pumped.pump(self._timeout, lambda: bool(self._answers)):
            raise SdoCommunicationError("No SDO response received")
        answer = self._answers.pop(0)
        if answer[0] == _ABORTED:
            raise SdoAbortedError(int.from_bytes(answer[4:8], "little"))
        self._size_left_open = answer[0] & _SIZE_INDICATION == _SIZE_LEFT_OPEN
        return answer


def expedited(index: int, subindex: int, data: bytes) -> bytes:
    """Return the request that writes an object of one to four bytes (CiA 301)."""
    command = _EXPEDITED | (4 - len(data)) << 2
    return struct.pack("<BHB4s", command, index, subindex, data)


def _nothing() -> None:
    pass
