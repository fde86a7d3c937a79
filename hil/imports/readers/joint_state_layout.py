"""Where a joint state has what, to read or write thousands of messages at once.

A message of `sensor_msgs/JointState` in CDR (OMG formal/02-06-51) is: encapsulation (4 bytes),
stamp (int32, uint32), frame_id (string), names (sequence of strings), and three sequences of
doubles. Strings and sequences begin with their length, an uint32; numbers are aligned to their
size, counted from behind the encapsulation. A publisher repeats all of that but stamp and doubles,
so messages whose other bytes are the same have their values at the same offsets, and numpy reads
them in one go. Padding is not compared: serializers leave there what the memory held before.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from hil.arrays import Array, Integers, Mask

    Bytes = NDArray[np.uint8]

LITTLE_ENDIAN = b"\x00\x01"
PARTS = ("position", "velocity", "effort")
_ENCAPSULATION = 4
_STAMP = slice(_ENCAPSULATION, _ENCAPSULATION + 8)


class OtherLayout(Exception):
    """Bytes that are no little-endian joint state of this layout."""


@dataclass(frozen=True, eq=False)
class MessageLayout:
    """Layout of messages that differ in stamp and values alone.

    Attributes
    ----------
    size : int
        Of a message [bytes].
    names : tuple of str
        Of the joints.
    values : dict of str to (int, int)
        Of each part its first byte and how many doubles it has.
    fixed : array (n,) of int
        Bytes that all messages have in common.
    content : array (n,) of uint8
        What these are.
    """

    size: int
    names: tuple[str, ...]
    values: dict[str, tuple[int, int]]
    fixed: Integers
    content: Bytes

    def fits(self, messages: Bytes) -> Mask:
        """Which of the messages, shape (n, size), are of this layout."""
        return np.asarray((messages[:, self.fixed] == self.content).all(axis=1))

    def stamps(self, messages: Bytes) -> tuple[Array, Array]:
        """Seconds and nanoseconds of messages (n, size)."""
        stamps = np.ascontiguousarray(messages[:, _STAMP])
        seconds, nanoseconds = stamps.view("<i4")[:, 0], stamps.view("<u4")[:, 1]
        return seconds.astype(np.float64), nanoseconds.astype(np.float64)

    def part(self, messages: Bytes, part: str) -> Array:
        """Values of one of `PARTS` of messages (n, size), shape (n, n_values)."""
        first, count = self.values[part]
        return np.ascontiguousarray(messages[:, first : first + 8 * count]).view("<f8")

    def messages(
        self, like: bytes, seconds: ArrayLike, nanoseconds: ArrayLike, parts: dict[str, Array]
    ) -> Bytes:
        """Messages that differ from one in stamp and values, shape (n, size).

        Parameters
        ----------
        like : bytes
            A message of this layout.
        seconds, nanoseconds : array (n,)
        parts : dict of str to array (n, n_values)
            By their names in `PARTS`; those without values may be left out.
        """
        stamps = np.column_stack([seconds, nanoseconds]).astype("<u4")
        found = np.tile(np.frombuffer(like, np.uint8), (len(stamps), 1))
        found[:, _STAMP] = stamps.view(np.uint8)
        for part, values in parts.items():
            first, count = self.values[part]
            doubles = np.ascontiguousarray(values, dtype="<f8")
            found[:, first : first + 8 * count] = doubles.view(np.uint8)
        return found


class _Cursor:
    """Goes through a message, and notes the bytes that are neither values nor padding."""

    def __init__(self, message: bytes) -> None:
        self._message = message
        self.at = _STAMP.stop
        self.fixed = [np.arange(_ENCAPSULATION)]

    def align(self, size: int) -> None:
        self.at += -(self.at - _ENCAPSULATION) % size

    def length(self) -> int:
        self.align(4)
        (length,) = struct.unpack_from("<I", self._message, self.at)
        self._fix(4)
        return int(length)

    def string(self) -> str:
        length = self.length()
        text = self._message[self.at : self.at + length]
        if not length or len(text) != length or text[-1]:
            raise OtherLayout
        self._fix(length)
        return text[:-1].decode()

    def doubles(self) -> tuple[int, int]:
        count = self.length()
        if count:
            self.align(8)
        first = self.at
        self.at += 8 * count
        return first, count

    def _fix(self, size: int) -> None:
        self.fixed.append(np.arange(self.at, self.at + size))
        self.at += size


def layout_of(message: bytes) -> MessageLayout:
    """Find the layout of a message.

    Raises
    ------
    OtherLayout
        It is big-endian, damaged, or no joint state.
    """
    if message[:2] != LITTLE_ENDIAN:
        raise OtherLayout
    cursor = _Cursor(message)
    try:
        cursor.string()
        names = tuple(cursor.string() for _ in range(min(cursor.length(), len(message))))
        values = {part: cursor.doubles() for part in PARTS}
    except (struct.error, UnicodeDecodeError) as error:
        raise OtherLayout from error
    # a message ends with 3 bytes of padding at most
    if not cursor.at <= len(message) <= cursor.at + 3:
        raise OtherLayout
    fixed = np.concatenate(cursor.fixed)
    content = np.frombuffer(message, np.uint8)[fixed]
    return MessageLayout(len(message), names, values, fixed, content)
