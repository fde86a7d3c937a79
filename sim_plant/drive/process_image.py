"""Process image of all axes, with detection of news.

Every SYNC latches all axes, and in nearly all of them nothing has happened to which a drive must
react. The known events of each drive and its range of positions without news are kept in arrays, so
that a single compiled call finds all axes with news. `FrameBlock` packs the image into the frames
that answer a SYNC.
"""

from __future__ import annotations

import struct
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sim_plant.compiled import compiled
from sim_plant.machine_protocol import Reading

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Integers = NDArray[np.int64]

WIDTH = len(Reading._fields)
STATUSWORD = WIDTH
"""Field of the statusword for `AxisImage.slot`, after the fields of `Reading`."""

_POSITION, _EVENTS = Reading._fields.index("position"), Reading._fields.index("events")
_KNOWN, _LOWEST, _HIGHEST = range(3)
_FAR = 1 << 62
_HEAD = struct.Struct("=IB3x")
_COLUMNS = 5
"""Slot, position in the block, size, lowest and highest value."""


class Field(NamedTuple):
    """Value of the process image within a frame: saturated at its bounds, little endian."""

    slot: int
    size: int
    low: int
    high: int


class ProcessImage:
    """Present values of all axes.

    Parameters
    ----------
    n_axes : int

    Attributes
    ----------
    values : ndarray, shape (8 n_axes,)
        The fields of every axis's `Reading`, axis after axis, then all statuswords; changed in
        place.
    statuswords : ndarray, shape (n_axes,)
        View of the statuswords in `values`.
    watch : ndarray, shape (3, n_axes)
        `AxisEvent` bits known to each drive, and range of positions without a report [increments].
    """

    def __init__(self, n_axes: int) -> None:
        self.values = np.zeros(n_axes * (WIDTH + 1), dtype=np.int64)
        self.statuswords = self.values[n_axes * WIDTH :]
        self.watch = np.zeros((3, n_axes), dtype=np.int64)
        self.watch[_LOWEST], self.watch[_HIGHEST] = -_FAR, _FAR
        _latch_and_pack(self.values, self.values, self.watch, _NO_FIELDS, _NO_FRAMES)

    def latch(self, readings: Integers) -> int:
        """Store the result of `Machine.read`; return the axes with news as a bit mask."""
        return _latch_and_pack(readings, self.values, self.watch, _NO_FIELDS, _NO_FRAMES)


class FrameBlock:
    """Frames that answer a SYNC, as consecutive ``struct can_frame`` of 16 bytes.

    Parameters
    ----------
    image : ProcessImage
        Source of the values.
    frames : sequence of (int, sequence of Field)
        Identifier and contents; they leave in the order of their identifiers.
    """

    def __init__(self, image: ProcessImage, frames: Sequence[tuple[int, Sequence[Field]]]) -> None:
        self._image = image
        self._frames = np.zeros(16 * len(frames), dtype=np.uint8)
        rows = []
        for number, (identifier, fields) in enumerate(sorted(frames, key=itemgetter(0))):
            place = 16 * number + _HEAD.size
            for field in fields:
                rows.append((field.slot, place, field.size, field.low, field.high))
                place += field.size
            head = _HEAD.pack(identifier, place - 16 * number - _HEAD.size)
            self._frames[16 * number : 16 * number + _HEAD.size] = list(head)
        self._fields = np.array(rows, dtype=np.int64).reshape(-1, _COLUMNS)
        self._memory = image.values, image.watch, self._fields, self._frames
        self.pack_all(image.values[None, : image.watch.shape[1] * WIDTH].copy())

    def latch(self, readings: Integers) -> int:
        """Latch as `ProcessImage.latch`, and pack; `frames` are valid if there are no news."""
        return _latch_and_pack(readings, *self._memory)

    def pack(self) -> None:
        """Pack the present image."""
        _pack(self._image.values, self._fields, self._frames)

    def pack_all(self, readings: Integers) -> list[bytes]:
        """Pack the frames of several SYNCs; readings of shape (k, 7 n_axes) without news."""
        size = len(self._frames)
        packed = np.empty((len(readings), size), dtype=np.uint8)
        _pack_all(readings, self._image.values, self._fields, self._frames, packed)
        whole = packed.tobytes()
        return [whole[k * size : (k + 1) * size] for k in range(len(readings))]

    @property
    def frames(self) -> bytes:
        """Most recently packed frames."""
        return self._frames.tobytes()


class AxisImage:
    """View of a single drive on the process image.

    Parameters
    ----------
    image : ProcessImage
    axis : int
        From 0.
    """

    def __init__(self, image: ProcessImage, axis: int) -> None:
        self.values = image.values
        self._watch = image.watch
        self._axis = axis
        self._first = axis * WIDTH
        self._statusword = image.watch.shape[1] * WIDTH + axis

    def slot(self, field: int) -> int:
        """Return the index in `values` of a field of `Reading`, or of `STATUSWORD`."""
        return self._statusword if field == STATUSWORD else self._first + field

    @property
    def reading(self) -> Reading:
        """Most recently latched reading."""
        return Reading(*self.values[self._first : self._first + WIDTH].tolist())

    @property
    def statusword(self) -> int:
        """Object 6041h."""
        return int(self.values[self._statusword])

    @statusword.setter
    def statusword(self, word: int) -> None:
        self.values[self._statusword] = word

    @property
    def events(self) -> int:
        """`AxisEvent` bits known to the drive."""
        return int(self._watch[_KNOWN, self._axis])

    @events.setter
    def events(self, bits: int) -> None:
        self._watch[_KNOWN, self._axis] = bits

    def expect_anything(self) -> None:
        """Report news at every SYNC."""
        self.expect_within(_FAR, -_FAR)

    def expect_nothing(self) -> None:
        """Report news of events only, at any position."""
        self.expect_within(-_FAR, _FAR)

    def expect_within(self, low: int, high: int) -> None:
        """Report news of events, and of positions outside the bounds [increments]."""
        self._watch[_LOWEST, self._axis], self._watch[_HIGHEST, self._axis] = low, high


_NO_FIELDS = np.zeros((0, _COLUMNS), dtype=np.int64)
_NO_FRAMES = np.zeros(0, dtype=np.uint8)


@compiled
def _pack(values: Integers, fields: Integers, frames: NDArray[np.uint8]) -> None:
    for row in range(fields.shape[0]):
        value = min(max(values[fields[row, 0]], fields[row, 3]), fields[row, 4])
        place = fields[row, 1]
        for _ in range(fields[row, 2]):
            frames[place] = value & 0xFF
            value >>= 8
            place += 1


@compiled
def _pack_all(
    readings: Integers,
    values: Integers,
    fields: Integers,
    frames: NDArray[np.uint8],
    packed: NDArray[np.uint8],
) -> None:
    for k in range(readings.shape[0]):
        for slot in range(readings.shape[1]):
            values[slot] = readings[k, slot]
        _pack(values, fields, frames)
        for place in range(frames.shape[0]):
            packed[k, place] = frames[place]


@compiled
def _latch_and_pack(
    readings: Integers,
    values: Integers,
    watch: Integers,
    fields: Integers,
    frames: NDArray[np.uint8],
) -> int:
    """Latch, compare and pack in a single call: entering compiled code costs more than the work."""
    for slot in range(readings.shape[0]):
        values[slot] = readings[slot]
    news = 0
    for axis in range(watch.shape[1]):
        first = axis * WIDTH
        position = values[first + _POSITION]
        changed = values[first + _EVENTS] != watch[_KNOWN, axis]
        outside = position < watch[_LOWEST, axis] or position > watch[_HIGHEST, axis]
        news |= (changed or outside) << axis
    _pack(values, fields, frames)
    return news
