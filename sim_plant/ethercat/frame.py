"""EtherCAT frames: datagrams after an Ethernet and a frame header, processed in place.

Every slave reads and writes a frame while the frame passes, and adds to the working counter of a
datagram: 1 for a read, 1 for a write, 2 for the write of a combined command (ETG.1000.4). A
datagram longer than the rest of its frame ends the processing; the remaining bytes pass unchanged.
"""

from __future__ import annotations

import enum
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

ETHERTYPE = 0x88A4
_ETHERNET = 14
DATAGRAMS = _ETHERNET + 2
"""Place of the first datagram, after the Ethernet header and the frame header."""
_HEADER = struct.Struct("<BBHHHH")
HEADER_SIZE = _HEADER.size
_COUNTER = struct.Struct("<H")
_DATAGRAM_TYPE = 1
"""Type in bits 12 to 15 of the frame header: datagrams."""
_MORE, _SIZE = 0x8000, 0x07FF
_PASSED = 0x02
"""Bit of the first byte of the source address, set by the first slave in the path."""


class Command(enum.IntEnum):
    """Commands of datagrams: by position, by address, broadcast, or logical memory."""

    NOP = 0
    APRD = 1
    APWR = 2
    APRW = 3
    FPRD = 4
    FPWR = 5
    FPRW = 6
    BRD = 7
    BWR = 8
    BRW = 9
    LRD = 10
    LWR = 11
    LRW = 12
    ARMW = 13
    FRMW = 14


LOGICAL = frozenset({Command.LRD, Command.LWR, Command.LRW})
POSITION = frozenset({Command.APRD, Command.APWR, Command.APRW, Command.ARMW})
BROADCAST = frozenset({Command.BRD, Command.BWR, Command.BRW})
MULTIPLE = frozenset({Command.ARMW, Command.FRMW})
"""Commands that read a single slave and write the result to all others."""
READING = frozenset(
    {Command.APRD, Command.APRW, Command.FPRD, Command.FPRW, Command.BRD, Command.BRW}
    | {Command.LRD, Command.LRW}
)
WRITING = frozenset(
    {Command.APWR, Command.APRW, Command.FPWR, Command.FPRW, Command.BWR, Command.BRW}
    | {Command.LWR, Command.LRW}
)
_COMMANDS = {int(command): command for command in Command}


@dataclass(slots=True)
class Datagram:
    """Datagram of a frame being processed.

    Attributes
    ----------
    frame : bytearray
        Complete frame.
    command : Command
    place : int
        Place of the header in the frame.
    size : int
        Size of the data [bytes].
    position, offset : int
        Slave address and place in its memory; together the logical address.
    """

    frame: bytearray
    command: Command
    place: int
    size: int
    position: int
    offset: int

    @property
    def logical(self) -> int:
        """Logical address of the data."""
        return self.offset << 16 | self.position

    @property
    def data(self) -> bytes:
        """Present data."""
        start = self.place + _HEADER.size
        return bytes(self.frame[start : start + self.size])

    @data.setter
    def data(self, data: bytes) -> None:
        start = self.place + _HEADER.size
        self.frame[start : start + self.size] = data

    def pass_on(self) -> None:
        """Increment the position address, as every slave does."""
        self.position = (self.position + 1) & 0xFFFF
        _COUNTER.pack_into(self.frame, self.place + 2, self.position)

    def count(self, number: int) -> None:
        """Add to the working counter, which wraps around."""
        place = self.place + _HEADER.size + self.size
        counter = _COUNTER.unpack_from(self.frame, place)[0]
        _COUNTER.pack_into(self.frame, place, (counter + number) & 0xFFFF)


def datagrams(frame: bytearray) -> Iterator[Datagram]:
    """Yield the datagrams of a frame in order; none for frames of other protocols."""
    if len(frame) < DATAGRAMS or int.from_bytes(frame[12:14], "big") != ETHERTYPE:
        return
    if frame[15] >> 4 != _DATAGRAM_TYPE:
        return
    place, more = DATAGRAMS, True
    while more and place + _HEADER.size + _COUNTER.size <= len(frame):
        number, _, position, offset, length, _ = _HEADER.unpack_from(frame, place)
        size, more = length & _SIZE, bool(length & _MORE)
        end = place + _HEADER.size + size + _COUNTER.size
        if end > len(frame):
            return
        command = _COMMANDS.get(number, Command.NOP)
        yield Datagram(frame, command, place, size, position, offset)
        place = end


def mark_passed(frame: bytearray) -> None:
    """Mark the source address of a frame that has passed slaves."""
    if len(frame) >= _ETHERNET:
        frame[6] |= _PASSED
