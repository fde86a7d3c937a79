"""PDO mappings: the objects of a frame, checked after CiA 301 and compiled to a struct.

A mapping is changed in this order: count 0, entries, count n, while its bus permits a change at
all. Anything else is refused. Entries are index << 16 | sub-index << 8 | bits; the indices 2 to 7
are dummies of a data type's width that an RPDO may use to skip bytes.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.eds import Entry
    from sim_plant.canopen.object_dictionary import ObjectDictionary

_DUMMY_BITS = {2: 8, 3: 16, 4: 32, 5: 8, 6: 16, 7: 32}


class PdoMapping:
    """Mapping object of a PDO.

    Parameters
    ----------
    dictionary : ObjectDictionary
    mapping : int
        Index of the mapping record.
    check_changeable : callable
        Raises `SdoAbort` where the mapping must not be changed now.
    receives : bool
        True for an RPDO: objects are written, and dummies are allowed.
    bytes_max : int
        Maximum size of the mapped objects together.
    """

    def __init__(
        self,
        dictionary: ObjectDictionary,
        mapping: int,
        check_changeable: Callable[[], None],
        *,
        receives: bool,
        bytes_max: int = 8,
    ) -> None:
        self._dictionary = dictionary
        self._mapping = mapping
        self._check_changeable = check_changeable
        self._receives = receives
        self._bytes_max = bytes_max
        dictionary.guard(mapping, self._check)

    def compile(self) -> tuple[struct.Struct, tuple[Entry, ...]]:
        """Return the frame's layout and the mapped entries in order."""
        layout, entries = "<", []
        for number in self._entries(self._dictionary.get(self._mapping)):
            if number >> 16 in _DUMMY_BITS:
                layout += f"{(number & 0xFF) // 8}x"
            else:
                entry = self._find(number)
                layout += entry.code
                entries.append(entry)
        return struct.Struct(layout), tuple(entries)

    def _entries(self, count: int) -> list[int]:
        return [self._dictionary.get(self._mapping, n) for n in range(1, count + 1)]

    def _check(self, subindex: int, value: int) -> None:
        self._check_changeable()
        if subindex == 0:
            self._check_count(value)
        elif self._dictionary.get(self._mapping) != 0:
            raise SdoAbort(AbortCode.UNSUPPORTED_ACCESS)
        elif value != 0:
            self._check_entry(value)

    def _check_count(self, count: int) -> None:
        entries = self._entries(count)
        if 0 in entries:
            raise SdoAbort(AbortCode.NOT_MAPPABLE)
        if sum(entry & 0xFF for entry in entries) > 8 * self._bytes_max:
            raise SdoAbort(AbortCode.PDO_LENGTH)

    def _check_entry(self, number: int) -> None:
        if number >> 16 in _DUMMY_BITS:
            bits = _DUMMY_BITS[number >> 16]
            if not self._receives or number & 0xFFFF != bits:
                raise SdoAbort(AbortCode.NOT_MAPPABLE)
            return
        entry = self._find(number)
        permitted = entry.writable if self._receives else entry.readable
        if not entry.mappable or not permitted or number & 0xFF != 8 * entry.size:
            raise SdoAbort(AbortCode.NOT_MAPPABLE)

    def _find(self, number: int) -> Entry:
        try:
            return self._dictionary.entry(number >> 16, number >> 8 & 0xFF)
        except SdoAbort as abort:  # also for a sub-index that does not exist
            raise SdoAbort(AbortCode.NO_OBJECT) from abort
