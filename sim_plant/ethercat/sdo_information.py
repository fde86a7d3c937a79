"""SDO information: objects of a drive with names, types and access (ETG.1000.6, 5.6.3)."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort

if TYPE_CHECKING:
    from sim_plant.canopen.eds import Entry
    from sim_plant.ethercat.objects import DriveObjects

_HEAD = struct.Struct("<BBH")
_INCOMPLETE = 0x80
_LIST, _OBJECT, _ENTRY, _ERROR = 1, 3, 5, 7
"""Operation codes of requests; a response has the next code."""
_NUMBERS, _ALL, _RECEIVED, _SENT, _, _SETTINGS = range(6)
"""Types of object lists (ETG.1000.6): lengths of all lists; all objects; objects mappable to an
RxPDO, to a TxPDO; stored objects; settings for a replacement device."""
_READABLE, _WRITABLE = 0x07, 0x38
"""Access in PREOP, SAFEOP and OP."""
_MAPPABLE_OUT, _MAPPABLE_IN = 0x40, 0x80


class SdoInformation:
    """Server of descriptions of a drive's objects.

    Parameters
    ----------
    objects : DriveObjects
    """

    def __init__(self, objects: DriveObjects) -> None:
        self._objects = objects.objects

    def answers(self, request: bytes, room: int) -> list[bytes]:
        """Return the answer to a request in fragments of at most `room` bytes."""
        if len(request) < _HEAD.size + 2:
            return []
        code, data = request[0] & 0x7F, request[_HEAD.size :]
        try:
            answer = self._answer(code, data)
        except SdoAbort as abort:
            return [_HEAD.pack(_ERROR, 0, 0) + struct.pack("<I", abort.code)]
        size = max(1, room - _HEAD.size)
        parts = [answer[at : at + size] for at in range(0, len(answer), size)]
        left = len(parts) - 1
        return [
            _HEAD.pack(code + 1 | (_INCOMPLETE if n < left else 0), 0, left - n) + part
            for n, part in enumerate(parts)
        ]

    def _answer(self, code: int, data: bytes) -> bytes:
        index = struct.unpack_from("<H", data)[0]
        if code == _LIST:
            return self._list(index)
        if code == _OBJECT:
            return self._describe(index)
        if code == _ENTRY and len(data) >= 3:
            return self._describe_entry(index, data[2])
        raise SdoAbort(AbortCode.UNKNOWN_COMMAND)

    def _list(self, kind: int) -> bytes:
        if kind == _NUMBERS:
            numbers = [len(self._chosen(other)) for other in range(_ALL, _SETTINGS + 1)]
        elif kind <= _SETTINGS:
            numbers = self._chosen(kind)
        else:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        return struct.pack(f"<H{len(numbers)}H", kind, *numbers)

    def _chosen(self, kind: int) -> list[int]:
        def fits(entry: Entry) -> bool:
            if kind == _RECEIVED:
                return entry.mappable and entry.writable
            if kind == _SENT:
                return entry.mappable and entry.readable
            return kind == _ALL  # nothing is stored, nothing set by a device to be replaced

        return [
            index
            for index, found in self._objects.items()
            if any(fits(member.entry) for member in found.entries.values())
        ]

    def _describe(self, index: int) -> bytes:
        found = self._objects.get(index)
        if found is None:
            raise SdoAbort(AbortCode.NO_OBJECT)
        head = struct.pack("<HHBB", index, found.data_type, max(found.entries), found.code)
        return head + found.name.encode("ascii", "replace")

    def _describe_entry(self, index: int, subindex: int) -> bytes:
        found = self._objects.get(index)
        if found is None:
            raise SdoAbort(AbortCode.NO_OBJECT)
        member = found.entries.get(subindex)
        if member is None:
            raise SdoAbort(AbortCode.NO_SUBINDEX)
        entry = member.entry
        access = (_READABLE if entry.readable else 0) | (_WRITABLE if entry.writable else 0)
        if entry.mappable:
            access |= _MAPPABLE_OUT if entry.writable else 0
            access |= _MAPPABLE_IN if entry.readable else 0
        head = struct.pack(
            "<HBBHHH", index, subindex, 0, member.data_type, min(member.bits, 0xFFFF), access
        )
        return head + member.name.encode("ascii", "replace")
