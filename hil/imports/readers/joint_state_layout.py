"""Byte layout of joint states, for reading and writing thousands of messages at once.

A message of `sensor_msgs/JointState` in CDR (OMG formal/02-06-51) is: encapsulation (4 bytes),
stamp (int32, uint32), frame_id (string), names (sequence of strings), and three sequences of
doubles. Strings and sequences begin with their length, an uint32; numbers are aligned to their
size, counted from the end of the encapsulation. A publisher repeats everything except stamp and
doubles, so messages with equal other bytes have their values at equal offsets, and numpy reads them
in a single call. Padding is not compared: serializers leave arbitrary bytes there.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from hil.arrays import Array, Integers, Mask

    Bytes = NDArray[np.uint8]

LITTLE_ENDIAN = b"\x00\x01"
PARTS = ("position", "velocity", "effort")
_STAMP = ("sec", "<i4", 4), ("nanosec", "<u4", 8)
"""Stamp after the encapsulation: name, type, and byte offset."""


class OtherLayout(Exception):
    """Message with another layout than a little-endian joint state."""


@dataclass(frozen=True, eq=False)
class MessageLayout:
    """Layout of messages that differ only in stamp and values.

    Attributes
    ----------
    names : tuple of str
        Names of the joints.
    values : dtype
        Type of a message: ``sec``, ``nanosec`` and `PARTS` at their places.
    fixed : array (n,) of int
        Indices of the bytes common to all messages.
    content : array (n,) of uint8
        Values of the bytes at `fixed`.
    """

    names: tuple[str, ...]
    values: np.dtype[np.void]
    fixed: Integers
    content: Bytes

    def fits(self, messages: bytes) -> Mask:
        """Return a mask of the messages of this layout in consecutive messages of equal size."""
        rows = np.frombuffer(messages, np.uint8).reshape(-1, self.values.itemsize)
        return np.asarray((rows[:, self.fixed] == self.content).all(axis=1))

    def messages(
        self, like: bytes, seconds: ArrayLike, nanoseconds: ArrayLike, parts: dict[str, Array]
    ) -> Bytes:
        """Return copies of a message with other stamps and values, shape (n, size).

        Parameters
        ----------
        like : bytes
            A message of this layout.
        seconds, nanoseconds : array (n,)
        parts : dict of str to array (n, n_values)
            Values by names in `PARTS`; parts without values may be left out.
        """
        n = len(np.asarray(seconds))
        found = np.frombuffer(bytearray(like * n), self.values)
        for name, values in {"sec": seconds, "nanosec": nanoseconds, **parts}.items():
            found[name] = values
        return found.view(np.uint8).reshape(n, -1)


class _Cursor:
    """Cursor through a message, which notes the bytes outside of values and padding."""

    def __init__(self, message: bytes) -> None:
        self._message = message
        self.at = 12
        self.fixed = [np.arange(4)]

    def align(self, size: int) -> None:
        self.at += -(self.at - 4) % size

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

    def doubles(self, part: str) -> tuple[str, tuple[str, tuple[int]], int]:
        """Read the length of a sequence of doubles; return name, type and byte offset."""
        count = self.length()
        if count:
            self.align(8)
        first = self.at
        self.at += 8 * count
        return part, ("<f8", (count,)), first

    def _fix(self, size: int) -> None:
        self.fixed.append(np.arange(self.at, self.at + size))
        self.at += size


def layout_of(message: bytes) -> MessageLayout:
    """Find the layout of a message.

    Raises
    ------
    OtherLayout
        The message is big-endian, damaged, or not a joint state.
    """
    if message[:2] != LITTLE_ENDIAN:
        raise OtherLayout
    cursor = _Cursor(message)
    try:
        cursor.string()
        names = tuple(cursor.string() for _ in range(min(cursor.length(), len(message))))
        values = [*_STAMP, *(cursor.doubles(part) for part in PARTS)]
    except (struct.error, UnicodeDecodeError) as error:
        raise OtherLayout from error
    # a message ends with at most 3 bytes of padding
    if not cursor.at <= len(message) <= cursor.at + 3:
        raise OtherLayout
    fixed = np.concatenate(cursor.fixed)
    content = np.frombuffer(message, np.uint8)[fixed]
    parts, formats, offsets = (list(each) for each in zip(*values, strict=True))
    places: Any = {"names": parts, "formats": formats, "offsets": offsets}
    values_of = np.dtype(places | {"itemsize": len(message)})
    return MessageLayout(names, values_of, fixed, content)
