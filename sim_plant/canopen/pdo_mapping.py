"""PDO mappings: which objects share a frame, checked as CiA 301 asks and compiled to one struct.

A mapping is changed in this order: PDO off (bit 31 of its COB-ID), count 0, entries, count n, PDO
on. Anything else is refused, save that a PDO whose COB-ID is read-only need not be off. Entries are
index << 16 | sub-index << 8 | bits; the indices 2 to 7 are dummies of a data type's width that an
RPDO may use to skip bytes.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.cob_id import INVALID

if TYPE_CHECKING:
    from sim_plant.canopen.eds import Entry
    from sim_plant.canopen.object_dictionary import ObjectDictionary

_DUMMY_BITS = {2: 8, 3: 16, 4: 32, 5: 8, 6: 16, 7: 32}
_BYTES_MAX = 8


class PdoMapping:
    """The mapping object of one PDO.

    Parameters
    ----------
    dictionary : ObjectDictionary
    parameters, mapping : int
        Indices of the communication and of the mapping record.
    receives : bool
        RPDO: objects are written, and dummies allowed.
    """

    def __init__(
        self, dictionary: ObjectDictionary, parameters: int, mapping: int, *, receives: bool
    ) -> None:
        self._dictionary = dictionary
        self._parameters = parameters
        self._mapping = mapping
        self._receives = receives
        dictionary.guard(mapping, self._check)

    def compile(self) -> tuple[struct.Struct, tuple[Entry, ...]]:
        """Return the frame's layout and the entries that it carries in order."""
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
        on = not self._dictionary.get(self._parameters, 1) & INVALID
        if on and self._dictionary.entry(self._parameters, 1).writable:
            raise SdoAbort(AbortCode.UNSUPPORTED_ACCESS)
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
        if sum(entry & 0xFF for entry in entries) > 8 * _BYTES_MAX:
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
