"""Mailboxes of a slave (ETG.1000.4 clause 5.6): services, answers and emergencies.

SDO services of CANopen over EtherCAT (ETG.1000.6 clause 5.6) begin with their type; SDO and
emergencies have the format of CAN, with data up to the size of the mailbox, and with segments
beyond.

The master numbers services from 1 to 7. If the returning frame is lost, the service is sent again,
and the slave drops the repetition by its number. A lost answer is requested by the repeat bit.
"""

from __future__ import annotations

import struct
import time
from typing import TYPE_CHECKING

from drivers.ethercat import registers as reg
from drivers.ethercat.line import ATTEMPTS, Command, Datagram, address_of
from drivers.ethercat.slaves import WHERE
from drivers.remote_dictionary import AccessRefused, NoAnswer

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.ethercat.eeprom import Area
    from drivers.ethercat.slaves import Station

HEADER = struct.Struct("<HHBB")
COE = 3
_ERROR = 0
_IN = reg.MANAGER + reg.MANAGER_SIZE
"""Sync manager registers of the mailbox to the master."""
_REPEAT = 0x02
WAITING = 64
"""Largest number of services during a wait for an answer: a slave may send without end."""
_WHERE = "its firmware, whose mailbox does not answer"


class Mailbox:
    """Mailboxes of a slave, in both directions.

    Parameters
    ----------
    station : Station
        The slave, in PREOP at least.
    out, back : Area
        Memory areas of the mailboxes.
    take : callable
        ``take(service)`` receives unsolicited services, such as emergencies.
    """

    def __init__(
        self, station: Station, out: Area, back: Area, take: Callable[[bytes], None]
    ) -> None:
        self._station, self._line = station, station.line
        self._out, self._back = out, back
        self._deliver = take
        self._counter = 0
        self._received = 0

    @property
    def capacity(self) -> int:
        """Largest length of a service [bytes]."""
        return min(self._out.size, self._back.size) - HEADER.size

    def exchange(self, service: bytes, is_answer: Callable[[bytes], bool], timeout: float) -> bytes:
        """Send a CoE service and return its answer.

        Parameters
        ----------
        service : bytes
            Service to send.
        is_answer : callable
            Returns True if a received service is the answer.
        timeout : float
            Longest response time [s].

        Raises
        ------
        NoAnswer
            There is no answer.
        BusUnavailable
            No frame returns.
        """
        ends = time.monotonic() + timeout
        self.collect()
        self.post(service, ends)
        for _ in range(WAITING):
            while (found := self._fetch()) is None:
                if time.monotonic() > ends:
                    raise NoAnswer("no answer in its mailbox", _WHERE)
                self._line.pause()
            if is_answer(found):
                return found
            self._deliver(found)
        raise NoAnswer(f"{WAITING} services received, none is the answer", _WHERE)

    def post(self, service: bytes, ends: float) -> None:
        """Put a CoE service into the mailbox, by the instant `ends` (errors as in `exchange`)."""
        self._counter = self._counter % 7 + 1
        content = HEADER.pack(len(service), 0, 0, COE | self._counter << 4) + service
        content = content.ljust(self._out.size, b"\0")
        place = address_of(self._station.address, self._out.start)
        lost = False
        while True:
            answers = self._line.exchange(Datagram(Command.FPWR, place, content))
            if answers is not None and (answers[0].counter == 1 or lost):
                return  # after a loss, a full mailbox contains the service sent before
            lost = lost or answers is None
            if time.monotonic() > ends:
                raise NoAnswer("its mailbox stays full", _WHERE)
            self._line.pause()

    def collect(self) -> None:
        """Receive pending mailbox services without waiting (errors as in `exchange`)."""
        for _ in range(WAITING):
            found = self._fetch()
            if found is None:
                return
            self._deliver(found)

    def _fetch(self) -> bytes | None:
        """Receive a new CoE service, None if there is none."""
        place = address_of(self._station.address, self._back.start)
        for _ in range(ATTEMPTS):
            answers = self._line.exchange(Datagram(Command.FPRD, place, bytes(self._back.size)))
            if answers is not None:
                break
            self._repeat()
        else:
            raise NoAnswer(f"its mailbox was lost {ATTEMPTS} times", WHERE)
        if answers[0].counter != 1:
            return None
        content = answers[0].data
        size, _, _, kind = HEADER.unpack_from(content)
        counter = kind >> 4 & 0x07
        again = counter and counter == self._received
        self._received = counter
        if again or size > len(content) - HEADER.size:
            return None
        if kind & 0x0F == _ERROR and size >= 4:
            detail = int.from_bytes(content[8:10], "little")
            raise NoAnswer(f"its mailbox reports error {detail:04X}h", _WHERE)
        return content[HEADER.size : HEADER.size + size] if kind & 0x0F == COE else None

    def _repeat(self) -> None:
        """Request the last service again; no effect if it still waits."""
        station = self._station
        activate = station.read(_IN + reg.MANAGER_ACTIVATE, 1)[0] ^ _REPEAT
        station.write(_IN + reg.MANAGER_ACTIVATE, bytes([activate]))
        for _ in range(WAITING):
            pdi = station.read(_IN + reg.MANAGER_PDI, 1)[0]
            if pdi & _REPEAT == activate & _REPEAT:
                break
            self._line.pause()


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
IN_MAILBOX = "its firmware and the size of its mailbox"
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
            raise NoAnswer(f"an answer of {length} bytes, at most {LONGEST} are read", IN_MAILBOX)
        data = answer[_INITIATE.size : _INITIATE.size + length]
        toggle = 0
        while len(data) < length:
            part, is_last = self._upload_segment(toggle)
            data += part
            toggle ^= _TOGGLE
            if is_last or not part:
                break
        if len(data) != length:
            raise NoAnswer(f"{len(data)} of {length} bytes received", IN_MAILBOX)
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
            raise NoAnswer(f"{len(data)} bytes do not fit into its mailbox", IN_MAILBOX)
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
