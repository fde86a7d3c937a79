"""SDO block transfers: up to 127 segments of seven bytes between two acknowledgements.

Within a block, the first byte of a segment holds its number (1...127), and bit 7 in the last
segment of the transfer. The receiver acknowledges the last number received in order, and the sender
continues after it, so that lost segments are repeated. The end frame holds the number of empty
bytes in the last segment, and the CRC (polynomial 1021h, start 0) if both sides agreed on a CRC.
"""

from __future__ import annotations

import binascii
import struct
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort

if TYPE_CHECKING:
    from sim_plant.canopen.sdo_incoming import Incoming

BLOCK_SIZE = 127
"""Segments per block, as requested by the server."""

_LAST = 0x80


class BlockDownload:
    """Block transfer towards the node."""

    def __init__(self, incoming: Incoming, *, checked: bool) -> None:
        self.index = incoming.index
        self.subindex = incoming.subindex
        self.in_block = True
        self.done = False
        self._incoming = incoming
        self._checked = checked
        self._expected = 1
        self._crc = 0
        self._held = b""
        self._last_seen = False

    def request(self, data: bytes) -> list[bytes]:
        """Process a segment, or the end of the transfer."""
        return self._segment(data) if self.in_block else self._end(data)

    def _segment(self, data: bytes) -> list[bytes]:
        number, last = data[0] & 0x7F, bool(data[0] & _LAST)
        if number == 0:
            raise SdoAbort(AbortCode.SEQUENCE_NUMBER)
        if number == self._expected:
            self._expected += 1
            self._keep(self._held)
            self._held = data[1:]
            self._last_seen = last
        if not last and number < BLOCK_SIZE:
            return []
        acknowledged, self._expected = self._expected - 1, 1
        self.in_block = not self._last_seen
        return [bytes([0xA2, acknowledged, BLOCK_SIZE]) + bytes(5)]

    def _end(self, data: bytes) -> list[bytes]:
        if data[0] & 0xE3 != 0xC1:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        self._keep(self._held[: 7 - (data[0] >> 2 & 0x07)])
        if self._checked and struct.unpack_from("<H", data, 1)[0] != self._crc:
            raise SdoAbort(AbortCode.CRC)
        self._incoming.finish()
        self.done = True
        return [bytes([0xA1]) + bytes(7)]

    def _keep(self, data: bytes) -> None:
        self._incoming.add(data)
        self._crc = binascii.crc_hqx(data, self._crc)


class BlockUpload:
    """Block transfer from the node.

    Raises
    ------
    SdoAbort
        BLOCK_SIZE for a block size outside 1...127.
    """

    def __init__(self, index: int, subindex: int, value: bytes, block_size: int) -> None:
        self.index = index
        self.subindex = subindex
        self.done = False
        self._value = value
        self._segments = [value[i : i + 7] for i in range(0, len(value), 7)] or [b""]
        self._position = 0
        self._sent = 0
        self._started = False
        self._ended = False
        self._set_block_size(block_size)

    def request(self, data: bytes) -> list[bytes]:
        """Process start, acknowledgement or end from the client."""
        if data[0] >> 5 != 5:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        command = data[0] & 0x03
        if command == 3 and not self._started:
            self._started = True
            return self._block()
        if command == 2 and self._started and not self._ended:
            return self._acknowledged(data[1], data[2])
        if command == 1 and self._ended:
            self.done = True
            return []
        raise SdoAbort(AbortCode.UNKNOWN_COMMAND)

    def _set_block_size(self, size: int) -> None:
        if not 1 <= size <= BLOCK_SIZE:
            raise SdoAbort(AbortCode.BLOCK_SIZE)
        self._block_size = size

    def _block(self) -> list[bytes]:
        segments = self._segments[self._position : self._position + self._block_size]
        self._sent = len(segments)
        last = len(self._segments) - self._position
        return [
            bytes([number | (_LAST if number == last else 0)]) + segment.ljust(7, b"\0")
            for number, segment in enumerate(segments, start=1)
        ]

    def _acknowledged(self, number: int, block_size: int) -> list[bytes]:
        if number > self._sent:
            raise SdoAbort(AbortCode.SEQUENCE_NUMBER)
        self._position += number
        if self._position < len(self._segments):
            self._set_block_size(block_size)
            return self._block()
        self._ended = True
        empty = 7 - len(self._segments[-1])
        return [struct.pack("<BH5x", 0xC1 | empty << 2, binascii.crc_hqx(self._value, 0))]
