"""EtherCAT frames of a master (ETG.1000.4): datagrams and their answers.

Slaves process a frame during its passage and return it in the same form, so a frame of another form
is no answer. The working counter of each datagram shows how many slaves took part.
"""

from __future__ import annotations

import enum
import struct
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

ETHERTYPE = 0x88A4
SHORTEST, LONGEST = 60, 1514
"""Length of an Ethernet frame without check sum [bytes]."""
START = 16
"""Offset of the first datagram, after the Ethernet and EtherCAT headers."""
HEAD, TAIL = 10, 2
"""Header and working counter of a datagram [bytes]."""
INDEX, SOURCE = 17, slice(7, 12)
"""Offset of the first datagram's index, and the part of the source address unchanged by slaves."""
MORE, SIZE = 0x8000, 0x07FF
_DATAGRAMS = 0x1000
"""Type in the frame header: datagrams follow."""
_HEADER = struct.Struct("<BBIHH")
_COUNTER = struct.Struct("<H")


class Command(enum.IntEnum):
    """Command of a datagram: by position, by address, broadcast, or logical memory."""

    APRD, APWR = 1, 2
    FPRD, FPWR = 4, 5
    BRD, BWR = 7, 8
    LRD, LRW = 10, 12
    FRMW = 14


class Datagram(NamedTuple):
    """Datagram; `address` is slave and register, or logical."""

    command: Command
    address: int
    data: bytes


class Answer(NamedTuple):
    """Answer to a datagram, with the number of slaves that took part."""

    data: bytes
    counter: int


def address_of(slave: int, place: int) -> int:
    """Return the address of a register of a slave (station address, or negative position)."""
    return slave & 0xFFFF | place << 16


def frame_of(source: bytes, datagrams: Sequence[Datagram]) -> bytearray:
    """Make a frame of datagrams.

    Parameters
    ----------
    source : bytes
        Address of the sender, six bytes.
    datagrams : sequence of Datagram
        Datagrams, at least one.

    Raises
    ------
    ValueError
        The datagrams do not fit into one frame.
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
    """Return the answers in a returned frame; None if it has another form."""
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
