"""SDO services of CANopen over EtherCAT (ETG.1000.6 clause 5.6).

A service begins with its type; SDO and emergencies have the format of CAN, with data up to the size
of the mailbox, and with segments beyond.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from drivers.remote_dictionary import AccessRefused, NoAnswer

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.ethercat.mailbox import Mailbox

EMERGENCY, SDO_REQUEST, SDO_RESPONSE = 1, 2, 3
_SERVICE = struct.Struct("<H")
_INITIATE = struct.Struct("<BHBI")
_HEADERS = _SERVICE.size + _INITIATE.size
_ABORT, _DOWNLOADED, _UPLOADED, _SEGMENT = 4, 3, 2, 0
_TOGGLE, _EXPEDITED, _SIZED, _LAST = 0x10, 0x02, 0x01, 0x01
_SHORTEST = 7
"""Smallest length of a segment's data, padded if necessary [bytes]."""
LONGEST = 4096
"""Largest length of a value [bytes]; the longest values read are names."""
WHERE = "its mailbox"
_WORDS = {
    0x05030000: "toggle bit not alternated",
    0x05040000: "time-out",
    0x05040001: "unknown command",
    0x05040005: "out of memory",
    0x06010000: "unsupported access",
    0x06010001: "write-only",
    0x06010002: "read-only",
    0x06010003: "sub-index 0 must be 0 first",
    0x06010004: "no complete access",
    0x06010006: "mapped, so no download",
    0x06020000: "no such object",
    0x06040041: "cannot be mapped",
    0x06040042: "mapping too long",
    0x06040043: "incompatible parameter",
    0x06040047: "incompatible with the device",
    0x06060000: "hardware error",
    0x06070010: "length does not match",
    0x06070012: "too long",
    0x06070013: "too short",
    0x06090011: "no such sub-index",
    0x06090030: "value outside its range",
    0x06090031: "value too high",
    0x06090032: "value too low",
    0x06090036: "maximum below minimum",
    0x08000000: "general error",
    0x08000020: "cannot be stored",
    0x08000021: "local control forbids it",
    0x08000022: "the state forbids it",
    0x08000023: "no object dictionary",
}


class SdoClient:
    """SDO client through a mailbox.

    Parameters
    ----------
    mailbox : Mailbox
        Mailbox of a slave.
    timeout : float
        Longest response time [s].
    """

    def __init__(self, mailbox: Mailbox, timeout: float) -> None:
        self._mailbox, self._timeout = mailbox, timeout

    def upload(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object (see `drivers.remote_dictionary.Access`)."""
        answer = self._initiate(_INITIATE.pack(0x40, index, subindex, 0), _UPLOADED)
        command = answer[0]
        if command & _EXPEDITED:
            if command & _SIZED:
                return answer[4 : 8 - (command >> 2 & 3)]
            return answer[4 : 4 + min(size or 4, 4)]
        length = int.from_bytes(answer[4:8], "little")
        if length > LONGEST:
            raise NoAnswer(f"an answer of {length} bytes, at most {LONGEST} are read", WHERE)
        data = answer[_INITIATE.size : _INITIATE.size + length]
        toggle = 0
        while len(data) < length:
            part, is_last = self._upload_segment(toggle)
            data += part
            toggle ^= _TOGGLE
            if is_last or not part:
                break
        if len(data) != length:
            raise NoAnswer(f"{len(data)} of {length} bytes came", WHERE)
        return data

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object of one to four bytes, or up to the size of the mailbox."""
        self._initiate(self._request(index, subindex, data), _DOWNLOADED)

    def order(self, index: int, subindex: int, data: bytes, ends: float) -> None:
        """Write an object without waiting for an answer, by the instant `ends`."""
        request = self._request(index, subindex, data)
        self._mailbox.post(_SERVICE.pack(SDO_REQUEST << 12) + request, ends)

    def _request(self, index: int, subindex: int, data: bytes) -> bytes:
        if len(data) <= 4:
            command = 0x20 | _EXPEDITED | _SIZED | (4 - len(data)) << 2
            return struct.pack("<BHB4s", command, index, subindex, data)
        if len(data) > self._mailbox.capacity - _HEADERS:
            raise NoAnswer(f"{len(data)} bytes do not fit into its mailbox", WHERE)
        return _INITIATE.pack(0x20 | _SIZED, index, subindex, len(data)) + data

    def _initiate(self, request: bytes, wanted: int) -> bytes:
        """Return the answer to a request that names an object."""
        return self._request_answer(request, lambda a: a[1:4] == request[1:4], wanted)

    def _upload_segment(self, toggle: int) -> tuple[bytes, bool]:
        request = bytes([0x60 | toggle]) + bytes(_SHORTEST)
        answer = self._request_answer(request, lambda a: a[0] & _TOGGLE == toggle, _SEGMENT)
        part = answer[1:]
        if len(part) == _SHORTEST:
            part = part[: _SHORTEST - (answer[0] >> 1 & 7)]
        return part, bool(answer[0] & _LAST)

    def _request_answer(self, request: bytes, fits: Callable[[bytes], bool], wanted: int) -> bytes:
        """Send a request and return its SDO answer of the kind `wanted`."""

        def is_answer(service: bytes) -> bool:
            answer = service[_SERVICE.size :]
            if len(answer) < _INITIATE.size or _kind(service) not in {SDO_REQUEST, SDO_RESPONSE}:
                return False
            return answer[0] >> 5 == _ABORT or (answer[0] >> 5 == wanted and fits(answer))

        service = _SERVICE.pack(SDO_REQUEST << 12) + request
        answer = self._mailbox.exchange(service, is_answer, self._timeout)[_SERVICE.size :]
        if answer[0] >> 5 == _ABORT:
            code = int.from_bytes(answer[4:8], "little")
            raise AccessRefused(code, _WORDS.get(code, "unknown abort code"))
        return answer


def _kind(service: bytes) -> int:
    return int.from_bytes(service[:2], "little") >> 12


def emergency_of(service: bytes) -> bytes | None:
    """Return the eight bytes of an emergency; None for another service."""
    if _kind(service) != EMERGENCY or len(service) < 10:
        return None
    return service[2:10]
