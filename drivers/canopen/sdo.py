"""SDO access to the object dictionaries of nodes (CiA 301): canopen's client, pumped."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, TypeVar

from canopen import ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from drivers.in_node import show_axis
from drivers.remote_dictionary import AccessRefused, NoAnswer, RemoteDictionary

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.canopen.network import PumpedNetwork
    from drivers.session.connection import Place

SDO_TIMEOUT = 0.5
"""Longest response time of a drive [s]."""
EXCHANGES = 64
"""Length of the longest accepted answer [frames of 7 bytes]."""
WHERE = "its node number, its bit rate, the CAN wiring, and sdo_timeout if it is slow at power-up"
"""Checks for a node that does not answer."""
NMT_START, NMT_ENTER_PRE_OPERATIONAL = 1, 128

_ABORTED = 0x80
_SDO_SIZE = 8
_SIZE_INDICATION = 0xE3
_SIZE_LEFT_OPEN = 0x42
"""Bits of an expedited upload response (command 2, e = 1) without size (s = 0)."""
_EXPEDITED = 0x23
"""Download request (command 1) with the data in the frame (e = 1) and their size (s = 1)."""
_INITIATING = frozenset({1, 2})
"""Command specifiers of requests whose response repeats index and sub-index."""

_Answer = TypeVar("_Answer")


class PumpedSdoClient(SdoClient):
    """canopen's SDO client with pumped waits.

    Parameters
    ----------
    network : PumpedNetwork
        Network, pumped during waits.
    node : int
        Node of the default SDO server.
    timeout : float
        Longest response time [s].
    """

    def __init__(self, network: PumpedNetwork, node: int, timeout: float) -> None:
        dictionary = ObjectDictionary()  # type: ignore[no-untyped-call]
        super().__init__(0x600 + node, 0x580 + node, dictionary)  # type: ignore[no-untyped-call]
        self.network, self._pumped, self._timeout = network, network, timeout
        self._answers: list[bytes] = []
        self._exchanges = 0
        self._object: bytes | None = None
        self._late = 0
        self.size_left_open = False
        network.subscribe(self.tx_cobid, self.take_response)

    def take_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Take a response from the network; a response without a request counts as late."""
        del can_id, timestamp
        if len(data) == _SDO_SIZE and self._object in (None, data[1:4]):
            self._answers.append(bytes(data))
        else:
            self._late += 1

    def upload(self, index: int, subindex: int) -> bytes:
        """Read an object, as canopen does."""
        self._exchanges = 0
        data: bytes = super().upload(index, subindex)
        return data

    def download(self, index: int, subindex: int, data: bytes, force_segment: bool = False) -> None:
        """Write an object, as canopen does."""
        self._exchanges = 0
        super().download(index, subindex, data, force_segment)

    def request_response(self, sdo_request: bytes) -> bytes:
        """Send a request and wait for the response; responses to earlier requests are dropped.

        Raises
        ------
        canopen.SdoCommunicationError
            There is no response, or no end to it.
        """
        self._exchanges += 1
        if self._exchanges > EXCHANGES:
            raise SdoCommunicationError(f"no end after {EXCHANGES} frames")
        self._pumped.pump(0.0)
        self._answers.clear()
        self._late = 0
        names_object = sdo_request[0] >> 5 in _INITIATING
        self._object = bytes(sdo_request[1:4]) if names_object else None
        self.send_request(sdo_request)  # type: ignore[no-untyped-call]
        return self.read_response()

    def read_response(self) -> bytes:
        """Wait for a response.

        Raises
        ------
        canopen.SdoAbortedError, canopen.SdoCommunicationError
            The server refuses the request; the server does not respond in time.
        """
        if not self._pumped.pump(self._timeout, lambda: bool(self._answers)):
            late = ", but one to an earlier request: its answers are late" if self._late else ""
            raise SdoCommunicationError(f"none within sdo_timeout, {self._timeout:g} s{late}")
        answer = self._answers.pop(0)
        if answer[0] == _ABORTED:
            raise SdoAbortedError(int.from_bytes(answer[4:8], "little"))
        self.size_left_open = answer[0] & _SIZE_INDICATION == _SIZE_LEFT_OPEN
        return answer


class SdoAccess:
    """Objects of a node through the default SDO server, and NMT commands.

    Parameters
    ----------
    network : PumpedNetwork
        Network of the node.
    node : int
        Node number.
    timeout : float
        Longest response time [s].
    """

    def __init__(self, network: PumpedNetwork, node: int, timeout: float) -> None:
        self._network, self._node = network, node
        self._client = PumpedSdoClient(network, node, timeout)

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object (see `drivers.remote_dictionary.Access`).

        A server may leave the number of valid bytes of an expedited response open (CiA 301: size
        indicator 0); then the size of the object applies. Other lengths are returned unchanged.
        """
        data = _translate_errors(lambda: self._client.upload(index, subindex))
        return data[:size] if self._client.size_left_open else data

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""
        _translate_errors(lambda: self._client.download(index, subindex, data))

    def order(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object of one to four bytes without waiting for an answer."""
        command = _EXPEDITED | (4 - len(data)) << 2
        request = struct.pack("<BHB4s", command, index, subindex, data)
        self._network.send_message(0x600 + self._node, request)

    def go_operational(self) -> None:
        """Command the node to start the exchange of process data (NMT start)."""
        self._network.send_message(0, bytes([NMT_START, self._node]))

    def leave_operational(self) -> None:
        """Command the node to stop the exchange of process data (NMT enter pre-operational)."""
        self._network.send_message(0, bytes([NMT_ENTER_PRE_OPERATIONAL, self._node]))


def server_of(network: PumpedNetwork, at: Place, timeout: float = SDO_TIMEOUT) -> RemoteDictionary:
    """Return the object dictionary of an axis (see `SdoAccess`, `RemoteDictionary`)."""
    access = show_axis(SdoAccess(network, at.node, timeout), at.within)
    return RemoteDictionary(access, at.node, at.name, at.within.axis)


def _translate_errors(access: Callable[[], _Answer]) -> _Answer:
    try:
        return access()
    except SdoAbortedError as error:
        words = SdoAbortedError.CODES.get(error.code, "unknown abort code")
        raise AccessRefused(error.code, words) from error
    except SdoError as error:
        raise NoAnswer(str(error), WHERE) from error
