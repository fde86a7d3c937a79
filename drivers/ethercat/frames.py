"""EtherCAT frames as a master makes and reads them (ETG.1000.4): datagrams and their answers.

Slaves work on a frame while it passes and send it back in the same form, so an answer that has
another form is none. Each datagram's working counter says how many of them took part.
"""

from __future__ import annotations

import enum
import struct
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

ETHERTYPE = 0x88A4
SHORTEST, LONGEST = 60, 1514
"""Of an Ethernet frame without its check sum [bytes]."""
START = 16
"""Where the first datagram begins: behind the Ethernet header and EtherCAT's own."""
HEAD, TAIL = 10, 2
"""Header and working counter of a datagram [bytes]."""
INDEX, SOURCE = 17, slice(7, 12)
"""Where the index of the first datagram stands, and what of the sender's address slaves leave."""
MORE, SIZE = 0x8000, 0x07FF
_DATAGRAMS = 0x1000
"""Type of the frame header: datagrams follow."""
_HEADER = struct.Struct("<BBIHH")
_COUNTER = struct.Struct("<H")


class Command(enum.IntEnum):
    """What a datagram asks of whom: by position, by address, of all, or of logical memory."""

    APRD, APWR = 1, 2
    FPRD, FPWR = 4, 5
    BRD, BWR = 7, 8
    LRD, LRW = 10, 12
    FRMW = 14


class Datagram(NamedTuple):
    """One datagram; `address` is slave and place, or a logical one."""

    command: Command
    address: int
    data: bytes


class Answer(NamedTuple):
    """What came back of one datagram, and how many slaves took part."""

    data: bytes
    counter: int


def at(slave: int, place: int) -> int:
    """Return the address of a place in the memory of a slave (address, or less its position)."""
    return slave & 0xFFFF | place << 16


def frame_of(source: bytes, datagrams: Sequence[Datagram]) -> bytearray:
    """Make a frame of datagrams.

    Parameters
    ----------
    source : bytes
        Address of the sender, six bytes.
    datagrams : sequence of Datagram
        One at least.

    Raises
    ------
    ValueError
        They do not fit into one frame.
    """
    body = bytearray()
    for number, (command, address, data) in enumerate(datagrams, start=1):
        more = MORE if number < len(datagrams) else 0
        body += _HEADER.pack(command, 0, address, len(data) | more, 0) + data + bytes(TAIL)
    head = b"\xff" * 6 + source + ETHERTYPE.to_bytes(2, "big")
    frame = bytearray(head) + struct.pack("<H", len(body) | _DATAGRAMS) + body
    if len(frame) > LONGEST:
        raise ValueError(f"{len(frame)} bytes are too long for a frame of {LONGEST}")
    return frame.ljust(SHORTEST, b"\0")


def answers_of(frame: bytes, datagrams: Sequence[Datagram]) -> tuple[Answer, ...] | None:
    """Return the answers in a frame that came back; None where it has another form."""
    answers, place = [], START
    for command, _, sent in datagrams:
        end = place + HEAD + len(sent)
        if end + TAIL > len(frame):
            return None
        found, _, _, length, _ = _HEADER.unpack_from(frame, place)
        if found != command or length & SIZE != len(sent):
            return None
        answers.append(Answer(frame[place + HEAD : end], _COUNTER.unpack_from(frame, end)[0]))
        place = end + TAIL
    return tuple(answers)
