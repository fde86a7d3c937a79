"""Object dictionary of a node: typed storage with access rights, ranges and hooks.

All services (SDO, PDO, NMT, the drive profile) use the dictionary. A write from the bus is checked
for access, length and range as stated in the EDS and by the *guards* of its index, which may refuse
it, is stored, and then passed to the *reactions* of its index. Some personalities round or clip a
value before the range check. A value stored elsewhere, such as the actual position, has a *source*
called at every reading.
"""

from __future__ import annotations

import functools
import struct
from collections import defaultdict
from typing import TYPE_CHECKING, TypeAlias

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.eds import Entry, drive_entries, inner_entries, key
from sim_plant.personality import PLAIN, Personality

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from sim_plant.personality import ObjectChange

Value: TypeAlias = int | bytes
RowReader: TypeAlias = "Callable[[], tuple[int, ...]]"
"""Function returning the present values of several objects."""
Hook: TypeAlias = "Callable[[int, int], None]"
"""Function called with sub-index and integer value."""

TEXT_MAX = 4096
"""Maximum length of a stored text [bytes]."""


class ObjectDictionary:
    """Values of a node, by index and sub-index.

    Parameters
    ----------
    node_id : int
    personality : Personality
        Objects visible on the bus; inside the node all objects exist.
    visible : callable
        Returns the visible entries of a personality, by `key`.
    axis : int
        Number of the axis in the node, from 1.

    Attributes
    ----------
    owner : tuple of int
        Node and axis, which name its timers.
    """

    def __init__(
        self,
        node_id: int,
        personality: Personality = PLAIN,
        visible: Callable[[Personality], Mapping[int, Entry]] = drive_entries,
        axis: int = 1,
    ) -> None:
        self.owner = (node_id, axis)
        self._entries = visible(personality)
        self._indices = {entry.index for entry in self._entries.values()}
        self._defaults = {
            number: entry.default + node_id
            if entry.relative and isinstance(entry.default, int)
            else entry.default
            for number, entry in inner_entries(personality, visible).items()
        }
        self._shapes = dict(_shapes(personality, self._entries))
        self._defaults |= {
            number: self._kept(number, self._defaults[number]) for number in self._shapes
        }
        self._values = dict(self._defaults)
        self._ranges: dict[int, tuple[int, int]] = {}
        self._sources: dict[int, Callable[[], int]] = {}
        self._slots: dict[int, int] = {}
        self._guards: defaultdict[int, list[Hook]] = defaultdict(list)
        self._reactions: defaultdict[int, list[Hook]] = defaultdict(list)

    # Access by the firmware

    def get(self, index: int, subindex: int = 0) -> int:
        """Return the present value of an integer object."""
        number = key(index, subindex)
        source = self._sources.get(number)
        value = source() if source else self._values[number]
        assert isinstance(value, int)  # noqa: S101 - text is only reached through upload
        return value

    def declares(self, index: int, subindex: int = 0) -> bool:
        """Return True if the EDS declares the object."""
        return key(index, subindex) in self._entries

    def imaged(self, objects: Mapping[int, int], image: NDArray[np.int64]) -> None:
        """Read the present values of objects (by `key`) from the given slots of `image`."""
        self._slots = dict(objects)
        for number, slot in self._slots.items():
            self._sources[number] = functools.partial(image.item, slot)

    def slot(self, number: int) -> int | None:
        """Return the slot of an object (by `key`) in the image; None if there is none."""
        return self._slots.get(number)

    def row_reader(self, numbers: Sequence[int]) -> RowReader:
        """Return a fast reader of several integer objects (by `key`)."""
        readers = [self._reader(number) for number in numbers]
        return lambda: tuple(read() for read in readers)

    def set(self, index: int, subindex: int, value: Value) -> None:
        """Store a value of the firmware: no access check, no hooks."""
        self._values[key(index, subindex)] = value

    def preset(self, index: int, subindex: int, value: Value) -> None:
        """Set the present value and the value after a reset, rounded or clipped by the drive."""
        number = key(index, subindex)
        self._defaults[number] = self._values[number] = self._kept(number, value)

    def limit(self, index: int, subindex: int, low: int, high: int) -> None:
        """Narrow the range that the bus may write."""
        self._ranges[key(index, subindex)] = (low, high)

    def allow(self, index: int, values: Collection[int]) -> None:
        """Let the bus write the given values only."""

        def check(_subindex: int, value: int) -> None:
            if value not in values:
                raise SdoAbort(AbortCode.INVALID_VALUE)

        self.guard(index, check)

    def source(self, index: int, subindex: int, read: Callable[[], int]) -> None:
        """Call `read` whenever the object is read."""
        self._sources[key(index, subindex)] = read

    def guard(self, index: int, check: Hook) -> None:
        """Let `check` refuse writes to `index` by raising `SdoAbort`."""
        self._guards[index].append(check)

    def react(self, index: int, action: Hook) -> None:
        """Call `action` after every write to `index` from the bus."""
        self._reactions[index].append(action)

    def reset(self, first: int, last: int) -> None:
        """Reset indices `first` to `last` to the values after power-on."""
        for number, value in self._defaults.items():
            if first <= number >> 8 <= last:
                self._values[number] = value

    # Access by the bus

    def entry(self, index: int, subindex: int) -> Entry:
        """Find a declared entry.

        Raises
        ------
        SdoAbort
            NO_OBJECT or NO_SUBINDEX.
        """
        found = self._entries.get(key(index, subindex))
        if found is None:
            known = index in self._indices
            raise SdoAbort(AbortCode.NO_SUBINDEX if known else AbortCode.NO_OBJECT)
        return found

    def upload(self, index: int, subindex: int) -> bytes:
        """Encode the present value.

        Raises
        ------
        SdoAbort
            Object unknown, write-only, or refused by its source.
        """
        entry = self.entry(index, subindex)
        if not entry.readable:
            raise SdoAbort(AbortCode.WRITE_ONLY)
        if not entry.code:
            text = self._values[key(index, subindex)]
            assert isinstance(text, bytes)  # noqa: S101 - by its declared type
            return text
        return struct.pack("<" + entry.code, wrapped(entry.code, self.get(index, subindex)))

    def check_download(self, index: int, subindex: int, size: int | None) -> Entry:
        """Check existence, access and announced length of a write, before its data arrive."""
        entry = self.entry(index, subindex)
        if not entry.writable:
            raise SdoAbort(AbortCode.READ_ONLY)
        if size is not None:
            largest, least = (entry.size, entry.size) if entry.code else (TEXT_MAX, 0)
            if size > largest:
                raise SdoAbort(AbortCode.LENGTH_HIGH)
            if size < least:
                raise SdoAbort(AbortCode.LENGTH_LOW)
        return entry

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Decode and write a value.

        Raises
        ------
        SdoAbort
            Object unknown, read-only, of wrong length, out of range, or refused by a guard.
        """
        entry = self.check_download(index, subindex, len(data))
        if entry.code:
            self.write(index, subindex, struct.unpack("<" + entry.code, data)[0])
        else:
            self.set(index, subindex, bytes(data))

    def write(self, index: int, subindex: int, value: int) -> None:
        """Write an integer from the bus: range, guards, storage, reactions."""
        self.writer(index, subindex)(value)

    def writer(self, index: int, subindex: int) -> Callable[[int], None]:
        """Return a fast function that does the same as `write` for one object."""
        number = key(index, subindex)
        entry = self._entries[number]
        stated = entry.low, entry.high
        ranges, values, shape = self._ranges, self._values, self._shapes.get(number)
        guards, reactions = self._guards[index], self._reactions[index]

        def write(value: int) -> None:
            if shape is not None:
                value = shape(value)
            low, high = ranges.get(number, stated)
            if value > high:
                raise SdoAbort(AbortCode.VALUE_HIGH)
            if value < low:
                raise SdoAbort(AbortCode.VALUE_LOW)
            for check in guards:
                check(subindex, value)
            values[number] = value
            for action in reactions:
                action(subindex, value)

        return write

    def _kept(self, number: int, value: Value) -> Value:
        """Return a value of the firmware, rounded and clipped by the personality."""
        shape = self._shapes.get(number)
        return shape(value) if shape is not None and isinstance(value, int) else value

    def _reader(self, number: int) -> Callable[[], int]:
        return self._sources.get(number) or functools.partial(self.get, number >> 8, number & 0xFF)


def _shapes(
    personality: Personality, entries: Mapping[int, Entry]
) -> Iterator[tuple[int, Callable[[int], int]]]:
    """Yield the rounding and clipping functions of a personality, by `key`."""
    for change in personality.objects:
        number = key(change.index, change.subindex)
        if change.step is not None or change.clip:
            yield number, functools.partial(_shaped, entries[number], change)


def _shaped(entry: Entry, change: ObjectChange, value: int) -> int:
    if change.step is not None:
        value = (value + change.step // 2) // change.step * change.step
    return min(max(value, entry.low), entry.high) if change.clip else value


def bounds(code: str) -> tuple[int, int]:
    """Return the range of an object; 32-bit counters wrap around and have no bounds."""
    bits = 8 * struct.calcsize("<" + code)
    low = -(1 << bits >> 1) if code.islower() else 0
    return (-(1 << 62), 1 << 62) if bits == 32 else (low, low + (1 << bits) - 1)


def wrapped(code: str, value: int) -> int:
    """Fit a measured value into its object: 32-bit counters wrap around, other types saturate.

    Parameters
    ----------
    code : str
        struct format of the object.
    value : int
        Any integer.
    """
    bits = 8 * struct.calcsize("<" + code)
    low = -(1 << bits >> 1) if code.islower() else 0
    if bits == 32:
        return (value - low) % (1 << bits) + low
    return min(max(value, low), low + (1 << bits) - 1)
