"""Raw Ethernet frames of EtherCAT on a network interface (Linux).

Frames pass through a socket of the kernel, so no installation is necessary, and every received byte
is read by Python, so that no slave can cause a write outside its buffers.
"""

from __future__ import annotations

import errno
import select
import socket
import struct
from typing import Protocol

from drivers.drive_bus import BusUnavailable
from drivers.sync_clock import LOCK_STEP_WAIT, poll_actively

ETHERTYPE = 0x88A4
BUFFER = 2048
"""Largest accepted frame [bytes]."""
_RECEIVE_TIMEOUT = getattr(socket, "SO_RCVTIMEO", 20)
_RIGHTS = (
    "raw Ethernet frames need root, or a Python with CAP_NET_RAW (sudo setcap cap_net_raw+ep of "
    "the interpreter itself)"
)


class Wire(Protocol):
    """Interface that sends and receives frames."""

    def send(self, frame: bytes | bytearray) -> bool:
        """Send a frame; return False if it was not sent.

        Raises
        ------
        BusUnavailable
            The interface no longer sends.
        """

    def receive(self, timeout: float) -> bytes | None:
        """Return the next frame, None if none arrives in time [s].

        Raises
        ------
        BusUnavailable
            The interface no longer receives.
        """

    def close(self) -> None:
        """Release the interface."""


class RawWire:
    """Raw socket on a network interface.

    Parameters
    ----------
    interface : str
        Name, such as eth0, of an interface without other uses.

    Raises
    ------
    BusUnavailable
        No such interface, no permission, or no Linux.
    """

    def __init__(self, interface: str) -> None:
        self._name = interface
        if not hasattr(socket, "AF_PACKET"):
            raise BusUnavailable("EtherCAT needs raw Ethernet frames, which are sent on Linux only")
        try:
            self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
        except PermissionError as error:
            raise BusUnavailable(f"{interface}: {_RIGHTS}") from error
        try:
            self._socket.bind((interface, ETHERTYPE))
        except OSError as error:
            self._socket.close()
            names = ", ".join(name for _, name in socket.if_nameindex())
            raise BusUnavailable(
                f"{interface}: {error.strerror}; network interfaces are {names}"
            ) from error
        self._blocks = 0.0

    def send(self, frame: bytes | bytearray) -> bool:
        """Send a frame; with a full queue the frame is lost, as on a cable."""
        try:
            self._socket.send(frame)
        except OSError as error:
            if error.errno in {errno.ENOBUFS, errno.EAGAIN}:
                return False
            raise self._gone(error) from error
        return True

    def receive(self, timeout: float) -> bytes | None:
        """Return the next frame, None if none arrives in time [s]."""
        try:
            if timeout < LOCK_STEP_WAIT:  # the socket's own time-out counts in ticks of the kernel
                if not select.select([self._socket], [], [], timeout)[0]:
                    return None
            elif (frame := poll_actively(self._poll)) is not None:
                return frame
            elif timeout != self._blocks:  # a blocking read saves a call of `select`
                interval = struct.pack("@ll", *divmod(round(timeout * 1e6), 1_000_000))
                self._socket.setsockopt(socket.SOL_SOCKET, _RECEIVE_TIMEOUT, interval)
                self._blocks = timeout
            return self._socket.recv(BUFFER)
        except BlockingIOError:
            return None
        except OSError as error:
            raise self._gone(error) from error

    def close(self) -> None:
        """Release the interface."""
        self._socket.close()

    def _poll(self) -> bytes | None:
        """Return a waiting frame, None if there is none."""
        try:
            return self._socket.recv(BUFFER, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None

    def _gone(self, error: OSError) -> BusUnavailable:
        return BusUnavailable(
            f"{self._name}: {error.strerror}; check that the interface is up (ip link set"
            f" {self._name} up) and its cable"
        )
