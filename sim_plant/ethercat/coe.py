"""CANopen over EtherCAT: SDO server of a drive, and its emergencies (ETG.1000.6 clause 5.6).

A service begins with its kind in bits 12 to 15 of two bytes; the remaining bytes have the layout of
an SDO on CAN, but may be as long as the mailbox. So a value of more than four bytes comes with the
first response, and segments follow only where the mailbox is too small. With complete access a
request concerns all sub-indices of an object at once, the first one padded to two bytes.
"""

from __future__ import annotations

import enum
import struct
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.object_dictionary import TEXT_MAX
from sim_plant.ethercat.sdo_information import SdoInformation

if TYPE_CHECKING:
    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.ethercat.mailbox import Mailbox
    from sim_plant.ethercat.objects import DriveObjects

_SERVICE = struct.Struct("<H")
_INITIATE = struct.Struct("<BHBI")
_HEADERS = _SERVICE.size + _INITIATE.size
_UPLOAD_SEGMENT = 3
_TOGGLE, _COMPLETE, _EXPEDITED, _SIZED, _LAST = 0x10, 0x10, 0x02, 0x01, 0x01
_SEGMENT_MIN = 7
"""Minimum length of a segment's data in bytes, padded if necessary."""


class Service(enum.IntEnum):
    """Kinds of CoE services."""

    EMERGENCY = 1
    SDO_REQUEST = 2
    SDO_RESPONSE = 3
    SDO_INFORMATION = 8


class _Transfer:
    """Segmented transfer of a value."""

    def __init__(self, index: int, subindex: int, data: bytes, *, complete: bool) -> None:
        self.index, self.subindex, self.complete = index, subindex, complete
        self.data = data
        self.toggle = 0
        self.size = 0
        """Announced size of a download [bytes]."""


class CoeServer:
    """Server of the objects of a drive.

    Parameters
    ----------
    dictionary : ObjectDictionary
    objects : DriveObjects
    mailbox : Mailbox
        Mailbox with the queued services.
    states_size : bool
        True if expedited uploads state the number of valid bytes.
    """

    def __init__(
        self,
        dictionary: ObjectDictionary,
        objects: DriveObjects,
        mailbox: Mailbox,
        *,
        states_size: bool = True,
    ) -> None:
        self._dictionary = dictionary
        self._objects = objects
        self._mailbox = mailbox
        self._send = mailbox.send
        self._states_size = states_size
        self._information = SdoInformation(objects)
        self._incoming: _Transfer | None = None
        self._outgoing: _Transfer | None = None
        self.abort_code: int | None = None
        """Abort code for all requests; None answers normally."""

    def reset(self) -> None:
        """Abandon the running transfer."""
        self._incoming = self._outgoing = None

    def emergency(self, data: bytes) -> None:
        """Send an emergency: code, error register, five manufacturer-specific bytes."""
        if not self._mailbox.is_crowded:
            self._send(_kind(Service.EMERGENCY) + data)

    def receive(self, service: bytes) -> None:
        """Process a service of at least two bytes, with any content."""
        kind, request = _SERVICE.unpack_from(service)[0] >> 12, service[_SERVICE.size :]
        if kind == Service.SDO_INFORMATION:
            room = self._mailbox.capacity - _SERVICE.size
            for answer in self._information.answers(request, room):
                self._send(_kind(Service.SDO_INFORMATION) + answer)
        elif kind == Service.SDO_REQUEST and len(request) >= _INITIATE.size:
            self._serve(request)

    def _serve(self, request: bytes) -> None:
        command, index, subindex, _ = _INITIATE.unpack_from(request)
        try:
            if self.abort_code is not None:
                self._respond_abort(index, subindex, self.abort_code)
                return
            complete = bool(command & _COMPLETE)
            match command >> 5:
                case 0:
                    self._download_segment(command, request[1:])
                case 1:
                    self._download(index, subindex, request, complete=complete)
                case 2:
                    self._upload(index, subindex, complete=complete)
                case 4:
                    self.reset()
                case _:
                    self._upload_segment(command)
        except SdoAbort as abort:
            under_way = self._incoming or self._outgoing
            if under_way is not None:
                index, subindex = under_way.index, under_way.subindex
            self.reset()
            self._respond_abort(index, subindex, abort.code)

    def _respond_abort(self, index: int, subindex: int, code: int) -> None:
        self._send(_kind(Service.SDO_REQUEST) + _INITIATE.pack(0x80, index, subindex, code))

    def _respond(self, response: bytes) -> None:
        self._send(_kind(Service.SDO_RESPONSE) + response)

    # Downloads

    def _download(self, index: int, subindex: int, request: bytes, *, complete: bool) -> None:
        self.reset()
        command, _, _, number = _INITIATE.unpack_from(request)
        transfer = _Transfer(index, subindex, b"", complete=complete)
        if not complete:
            self._dictionary.check_download(index, subindex, None)
        if command & _EXPEDITED:
            size = 4 - (command >> 2 & 0x03) if command & _SIZED else self._width(transfer)
            transfer.data, transfer.size = request[4 : 4 + size], size
        else:
            transfer.size = number
            if number > TEXT_MAX:
                raise SdoAbort(AbortCode.LENGTH_HIGH)
            transfer.data = request[_INITIATE.size : _INITIATE.size + number]
        if len(transfer.data) == transfer.size:
            self._write(transfer)
        else:
            self._incoming = transfer
        self._respond(_INITIATE.pack(0x60 | command & _COMPLETE, index, subindex, 0))

    def _download_segment(self, command: int, data: bytes) -> None:
        transfer = self._incoming
        if transfer is None:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        if command & _TOGGLE != transfer.toggle:
            raise SdoAbort(AbortCode.TOGGLE_BIT)
        if len(data) == _SEGMENT_MIN:
            data = data[: _SEGMENT_MIN - (command >> 1 & 0x07)]
        transfer.data += data
        if len(transfer.data) > transfer.size:
            raise SdoAbort(AbortCode.LENGTH_HIGH)
        if command & _LAST:
            if len(transfer.data) != transfer.size:
                raise SdoAbort(AbortCode.LENGTH_LOW)
            self._write(transfer)
            self._incoming = None
        self._respond(bytes([0x20 | transfer.toggle]) + bytes(7))
        transfer.toggle ^= _TOGGLE

    def _write(self, transfer: _Transfer) -> None:
        if transfer.complete:
            self._write_all(transfer.index, transfer.subindex, transfer.data)
        else:
            self._dictionary.download(transfer.index, transfer.subindex, transfer.data)

    def _width(self, transfer: _Transfer) -> int:
        return self._dictionary.entry(transfer.index, transfer.subindex).size or 4

    # Uploads

    def _upload(self, index: int, subindex: int, *, complete: bool) -> None:
        self.reset()
        if complete:
            value = self._read_all(index, subindex)
        else:
            value = self._dictionary.upload(index, subindex)
        flag = _COMPLETE if complete else 0
        if 1 <= len(value) <= 4:
            stated = 0x43 | (4 - len(value)) << 2 if self._states_size else 0x42
            number = int.from_bytes(value, "little")
            self._respond(_INITIATE.pack(stated | flag, index, subindex, number))
            return
        room = max(0, self._mailbox.capacity - _HEADERS)
        if len(value) > room:
            self._outgoing = _Transfer(index, subindex, value[room:], complete=complete)
        head = _INITIATE.pack(0x41 | flag, index, subindex, len(value))
        self._respond(head + value[:room])

    def _upload_segment(self, command: int) -> None:
        transfer = self._outgoing
        if transfer is None or command >> 5 != _UPLOAD_SEGMENT:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        if command & _TOGGLE != transfer.toggle:
            raise SdoAbort(AbortCode.TOGGLE_BIT)
        room = max(_SEGMENT_MIN, self._mailbox.capacity - _SERVICE.size - 1)
        part, transfer.data = transfer.data[:room], transfer.data[room:]
        unused = max(0, _SEGMENT_MIN - len(part))
        last = 0 if transfer.data else _LAST
        head = transfer.toggle | unused << 1 | last
        self._respond(bytes([head]) + part.ljust(_SEGMENT_MIN, b"\0"))
        transfer.toggle ^= _TOGGLE
        if last:
            self._outgoing = None

    # Complete access

    def _read_all(self, index: int, start: int) -> bytes:
        subindices = self._complete(index, start)
        count = self._dictionary.get(index)
        parts = [
            self._dictionary.upload(index, n) + (b"" if n else b"\0")
            for n in subindices
            if n <= count
        ]
        return b"".join(parts)

    def _write_all(self, index: int, start: int, data: bytes) -> None:
        """Write the entries covered by the data; sub-index 0 is written last."""
        dictionary, place, values = self._dictionary, 0, []
        for subindex in self._complete(index, start):
            if place >= len(data):
                break
            size = dictionary.entry(index, subindex).size
            part = data[place : place + size]
            if len(part) < size:
                raise SdoAbort(AbortCode.LENGTH_LOW)
            values.append((subindex, part))
            place += size + (subindex == 0)
        if place < len(data):
            raise SdoAbort(AbortCode.LENGTH_HIGH)
        if values and values[0][0] == 0:
            number = values.pop(0)[1]
            if dictionary.entry(index, 0).writable:
                dictionary.download(index, 0, b"\0")
                values.append((0, number))
            elif number != dictionary.upload(index, 0):
                raise SdoAbort(AbortCode.READ_ONLY)
        for subindex, part in values:
            dictionary.download(index, subindex, part)

    def _complete(self, index: int, start: int) -> list[int]:
        self._dictionary.entry(index, 0)
        found = self._objects.objects[index]
        if start > 1 or set(found.entries) == {0}:
            raise SdoAbort(AbortCode.UNSUPPORTED_ACCESS)
        return [subindex for subindex in sorted(found.entries) if subindex >= start]


def _kind(service: Service) -> bytes:
    return _SERVICE.pack(service << 12)
