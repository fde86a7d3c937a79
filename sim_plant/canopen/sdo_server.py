"""SDO server of a node: expedited and segmented transfers, and dispatch of requests.

Requests and responses are eight bytes: a command specifier in bits 7-5 of the first, then index and
sub-index (little endian), then data. One transfer runs at a time; a new initiate request abandons
it. An invalid request is answered with an abort, and no request raises an exception. Block
transfers are in `sdo_block`.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Protocol

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.sdo_block import BLOCK_SIZE, BlockDownload, BlockUpload
from sim_plant.canopen.sdo_incoming import Incoming

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.sdo_incoming import Served

_HEADER = struct.Struct("<BHB")
_SIZE = struct.Struct("<I")
_TOGGLE = 0x10
_UNDEFINED = b"\xa5"
"""Filler of unused bytes in responses without a size."""


class Transfer(Protocol):
    """SDO transfer of several requests, segmented or by blocks."""

    index: int
    subindex: int

    def request(self, data: bytes) -> list[bytes]:
        """Answer the next request of this transfer."""

    @property
    def done(self) -> bool:
        """True if the last request ended the transfer."""


class SdoServer:
    """Server of an object dictionary for a single client.

    Parameters
    ----------
    dictionary : Served
    respond : callable
        Sends eight bytes to the client.
    states_size : bool
        True if expedited uploads state the number of valid bytes.
    """

    def __init__(
        self,
        dictionary: Served,
        respond: Callable[[bytes], None],
        *,
        states_size: bool = True,
    ) -> None:
        self._states_size = states_size
        self._dictionary = dictionary
        self._respond = respond
        self._transfer: Transfer | None = None

    def serve(self, dictionary: Served) -> None:
        """Replace the served dictionary."""
        self._dictionary = dictionary

    def reset(self) -> None:
        """Abandon the running transfer."""
        self._transfer = None

    def receive(self, data: bytes) -> None:
        """Answer a request frame; ignore frames of other lengths than eight bytes."""
        if len(data) != 8:
            return
        if data[0] == 0x80:
            self._transfer = None
            return
        try:
            responses = self._answer(data)
        except SdoAbort as abort:
            responses = [self._abort(data, abort.code)]
            self._transfer = None
        for response in responses:
            self._respond(response)

    def _answer(self, data: bytes) -> list[bytes]:
        transfer = self._transfer
        if isinstance(transfer, BlockDownload) and transfer.in_block:
            return self._continue(data)
        command = data[0] >> 5
        if command == 1:
            return self._initiate_download(data)
        if command == 2:
            return self._initiate_upload(data)
        if command == 5 and data[0] & 0x03 == 0:
            return self._initiate_block_upload(data)
        if command == 6 and data[0] & 0x01 == 0:
            return self._initiate_block_download(data)
        return self._continue(data)

    def _continue(self, data: bytes) -> list[bytes]:
        if self._transfer is None:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        responses = self._transfer.request(data)
        if self._transfer.done:
            self._transfer = None
        return responses

    def _initiate_download(self, data: bytes) -> list[bytes]:
        self._transfer = None
        command, index, subindex = _HEADER.unpack_from(data)
        if command & 0x02:
            self._download_expedited(command, index, subindex, data[4:])
        else:
            size = _SIZE.unpack_from(data, 4)[0] if command & 0x01 else None
            self._transfer = SegmentedDownload(Incoming(self._dictionary, index, subindex, size))
        return [_HEADER.pack(0x60, index, subindex) + bytes(4)]

    def _download_expedited(self, command: int, index: int, subindex: int, data: bytes) -> None:
        if command & 0x01:
            size = 4 - (command >> 2 & 0x03)
        else:  # no size given: as much as the object holds
            size = self._dictionary.check_download(index, subindex, None).size or 4
        self._dictionary.download(index, subindex, data[:size])

    def _initiate_upload(self, data: bytes) -> list[bytes]:
        self._transfer = None
        _, index, subindex = _HEADER.unpack_from(data)
        value = self._dictionary.upload(index, subindex)
        if 1 <= len(value) <= 4:
            return [self._expedited(index, subindex, value)]
        self._transfer = SegmentedUpload(index, subindex, value)
        return [_HEADER.pack(0x41, index, subindex) + _SIZE.pack(len(value))]

    def _expedited(self, index: int, subindex: int, value: bytes) -> bytes:
        if not self._states_size:
            return _HEADER.pack(0x42, index, subindex) + value.ljust(4, _UNDEFINED)
        command = 0x43 | (4 - len(value)) << 2
        return _HEADER.pack(command, index, subindex) + value.ljust(4, b"\0")

    def _initiate_block_upload(self, data: bytes) -> list[bytes]:
        self._transfer = None
        _, index, subindex = _HEADER.unpack_from(data)
        block_size, threshold = data[4], data[5]
        value = self._dictionary.upload(index, subindex)
        if threshold and len(value) <= threshold:
            return self._initiate_upload(data)
        self._transfer = BlockUpload(index, subindex, value, block_size)
        return [_HEADER.pack(0xC6, index, subindex) + _SIZE.pack(len(value))]

    def _initiate_block_download(self, data: bytes) -> list[bytes]:
        self._transfer = None
        command, index, subindex = _HEADER.unpack_from(data)
        size = _SIZE.unpack_from(data, 4)[0] if command & 0x02 else None
        incoming = Incoming(self._dictionary, index, subindex, size)
        self._transfer = BlockDownload(incoming, checked=bool(command & 0x04))
        return [_HEADER.pack(0xA4, index, subindex) + bytes([BLOCK_SIZE, 0, 0, 0])]

    def _abort(self, data: bytes, code: AbortCode) -> bytes:
        if self._transfer is None:
            _, index, subindex = _HEADER.unpack_from(data)
        else:
            index, subindex = self._transfer.index, self._transfer.subindex
        return _HEADER.pack(0x80, index, subindex) + _SIZE.pack(code)


class SegmentedDownload:
    """Segmented transfer towards the node, seven bytes per request."""

    def __init__(self, incoming: Incoming) -> None:
        self.index = incoming.index
        self.subindex = incoming.subindex
        self._incoming = incoming
        self._toggle = 0
        self.done = False

    def request(self, data: bytes) -> list[bytes]:
        """Process a segment; the last segment writes the object."""
        command = data[0]
        if command >> 5 != 0:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        if command & _TOGGLE != self._toggle:
            raise SdoAbort(AbortCode.TOGGLE_BIT)
        self._incoming.add(data[1 : 8 - (command >> 1 & 0x07)])
        if command & 0x01:
            self._incoming.finish()
            self.done = True
        response = bytes([0x20 | self._toggle]) + bytes(7)
        self._toggle ^= _TOGGLE
        return [response]


class SegmentedUpload:
    """Segmented transfer from the node, seven bytes per response."""

    def __init__(self, index: int, subindex: int, value: bytes) -> None:
        self.index = index
        self.subindex = subindex
        self._rest = value
        self._toggle = 0
        self.done = False

    def request(self, data: bytes) -> list[bytes]:
        """Answer with the next segment."""
        command = data[0]
        if command >> 5 != 3:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        if command & _TOGGLE != self._toggle:
            raise SdoAbort(AbortCode.TOGGLE_BIT)
        segment, self._rest = self._rest[:7], self._rest[7:]
        self.done = not self._rest
        first = self._toggle | (7 - len(segment)) << 1 | self.done
        self._toggle ^= _TOGGLE
        return [bytes([first]) + segment.ljust(7, b"\0")]
