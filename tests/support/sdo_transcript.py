"""SDO and NMT messages between a master and its drives, as readable lines.

The frames come from python-can and are decoded here by hand (CiA 301), without the code of driver
and plant. A line is one transfer: node, direction, index and sub-index, then the abort code or the
value, as a hexadecimal number of the object's length, or as text if longer than four bytes. Equal
successive lines become one line with a count.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import can

NMT = {1: "start", 2: "stop", 128: "pre-operational", 129: "reset", 130: "reset communication"}
MEASURED = frozenset({0x30D1, 0x6064, 0x6077, 0x6078})
"""Position and currents: their last digit depends on the processor, so their values are omitted."""


def transcript(frames: Iterable[can.Message], nodes: Iterable[int]) -> list[str]:
    """Return the messages of some nodes, in order, without SYNC, PDOs and heartbeats."""
    conversations = {node: _Conversation(node) for node in nodes}
    lines: list[str] = []
    for frame in frames:
        service, node, data = frame.arbitration_id & 0x780, frame.arbitration_id & 0x7F, frame.data
        if frame.arbitration_id == 0:
            lines += _command(bytes(data), conversations)
        elif node in conversations and service == 0x600:
            lines += conversations[node].request(bytes(data))
        elif node in conversations and service == 0x580:
            lines += conversations[node].response(bytes(data))
    for conversation in conversations.values():
        lines += conversation.given_up()
    return [_counted(line, len(list(group))) for line, group in groupby(lines)]


def _command(data: bytes, nodes: Iterable[int]) -> Iterator[str]:
    command, addressed = data
    for node in nodes:
        if addressed in {0, node}:
            yield f"{node} nmt   {NMT[command]}"


def _counted(line: str, times: int) -> str:
    return line if times == 1 else f"{line} ({times} times)"


@dataclass
class _Conversation:
    """Sequence of SDO transfers of one node.

    The topmost three bits of the first byte are the command; the meaning of a number differs
    between request and response.
    """

    node: int
    what: str = ""
    place: tuple[int, ...] = (0, 0)
    data: bytes = b""
    last: bool = False
    """True if the present segment, or the only frame of an expedited transfer, is the last one."""

    def request(self, frame: bytes) -> Iterator[str]:
        """Process a frame of the master."""
        command = frame[0] >> 5
        if command == 1:  # initiate download
            yield from self.begun("write", frame)
        elif command == 2:  # initiate upload
            yield from self.begun("read", frame)
        elif command == 0:  # a segment of a download
            self.data += _segment(frame)
            self.last = _is_last(frame)
        elif command == 4:
            yield self._ended(f"given up, {_abort(frame)}")

    def response(self, frame: bytes) -> Iterator[str]:
        """Process a frame of the drive."""
        command = frame[0] >> 5
        if command == 2 and _is_expedited(frame):
            self.data, self.last = _expedited(frame), True
        elif command == 0:  # a segment of an upload
            self.data += _segment(frame)
            self.last = _is_last(frame)
        if command == 4:
            yield self._ended(_abort(frame))
        elif self.last:
            yield self._ended(self._value())

    def begun(self, what: str, frame: bytes) -> Iterator[str]:
        """Begin a transfer; a pending transfer counts as unanswered."""
        yield from self.given_up()
        self.what, self.place = what, struct.unpack_from("<HB", frame, 1)
        self.last = what == "write" and _is_expedited(frame)
        self.data = _expedited(frame) if self.last else b""

    def given_up(self) -> Iterator[str]:
        """End a pending transfer as unanswered."""
        if self.what:
            yield self._ended("no answer")

    def _ended(self, result: str) -> str:
        index, subindex = self.place
        line = f"{self.node} {self.what:5} {index:04X}:{subindex:02X} {result}"
        self.what, self.last = "", False
        return line

    def _value(self) -> str:
        if self.place[0] in MEASURED:
            return "measured"
        if len(self.data) > 4:
            return ascii(self.data.decode("latin-1"))
        return self.data[::-1].hex().upper()


def _is_expedited(frame: bytes) -> bool:
    return bool(frame[0] & 0x02)


def _is_last(frame: bytes) -> bool:
    return bool(frame[0] & 0x01)


def _expedited(frame: bytes) -> bytes:
    """Return the value; all four bytes if their number is not indicated."""
    return frame[4 : 8 - (frame[0] >> 2 & 3 if frame[0] & 0x01 else 0)]


def _segment(frame: bytes) -> bytes:
    return frame[1 : 8 - (frame[0] >> 1 & 7)]


def _abort(frame: bytes) -> str:
    return f"abort {int.from_bytes(frame[4:8], 'little'):08X}"
