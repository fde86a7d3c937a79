"""Small EtherCAT master for tests of slaves without a wire, with frames made by hand."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from sim_plant.ethercat.frame import Command

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

ETHERNET = b"\xff" * 6 + b"\x00\x01\x02\x03\x04\x05" + b"\x88\xa4"
MAILBOX_OUT, MAILBOX_IN, OUTPUTS, INPUTS = 0x1000, 0x1400, 0x1800, 0x1C00
MAILBOX_SIZE = 512
INIT, PREOP, SAFEOP, OP = 1, 2, 4, 8


class Answer(NamedTuple):
    """Answer to one datagram."""

    data: bytes
    counter: int


class SdoRefused(Exception):
    """Abort of an SDO, with its code."""


def frame_of(*datagrams: tuple[int, int, int, bytes]) -> bytes:
    """Return a frame of datagrams: command, address, place, data."""
    body = b""
    for n, (command, position, place, data) in enumerate(datagrams, start=1):
        more = 0x8000 if n < len(datagrams) else 0
        head = struct.pack("<BBHHHH", command, n, position, place, len(data) | more, 0)
        body += head + data + bytes(2)
    return ETHERNET + struct.pack("<H", len(body) | 0x1000) + body


def answers_of(frame: bytes) -> list[Answer]:
    """Return the answers in a returned frame."""
    place, found = 16, []
    while True:
        length = struct.unpack_from("<H", frame, place + 6)[0]
        size = length & 0x7FF
        data = frame[place + 10 : place + 10 + size]
        found.append(Answer(data, struct.unpack_from("<H", frame, place + 10 + size)[0]))
        place += 12 + size
        if not length & 0x8000:
            return found


class Master:
    """Master that addresses slaves by position, from 0.

    Parameters
    ----------
    process : callable
        Function that returns the answer to a frame.
    mailbox_size : int
    """

    def __init__(
        self, process: Callable[[bytes], bytes | None], mailbox_size: int = MAILBOX_SIZE
    ) -> None:
        self._size = mailbox_size
        self._process = process
        self._counters: dict[int, int] = {}

    def send(self, *datagrams: tuple[int, int, int, bytes]) -> list[Answer]:
        """Send a frame and return the answers; a lost frame has none."""
        frame = self._process(frame_of(*datagrams))
        return [] if frame is None else answers_of(frame)

    def read(self, slave: int, place: int, size: int) -> Answer:
        return self.send((Command.APRD, -slave & 0xFFFF, place, bytes(size)))[0]

    def write(self, slave: int, place: int, data: bytes) -> int:
        return self.send((Command.APWR, -slave & 0xFFFF, place, data))[0].counter

    def word(self, slave: int, place: int) -> int:
        return int.from_bytes(self.read(slave, place, 2).data, "little")

    def state(self, slave: int) -> tuple[int, int]:
        """Return AL status (with the error flag in bit 4) and its code."""
        return self.word(slave, 0x130), self.word(slave, 0x134)

    def request(self, slave: int, state: int) -> tuple[int, int]:
        """Request a state and return the state shown then."""
        self.write(slave, 0x120, struct.pack("<H", state))
        return self.state(slave)

    def set_manager(self, slave: int, number: int, start: int, size: int, control: int) -> None:
        raw = struct.pack("<HHBBBB", start, size, control, 0, int(size > 0), 0)
        self.write(slave, 0x800 + 8 * number, raw)

    def enter_preop(self, slave: int) -> None:
        self.set_manager(slave, 0, MAILBOX_OUT, self._size, 0x26)
        self.set_manager(slave, 1, MAILBOX_IN, self._size, 0x22)
        assert self.request(slave, PREOP) == (PREOP, 0)

    def enter_safeop(self, slave: int, sizes: tuple[int, int] = (12, 12)) -> None:
        """Map process data of slave n to 100h n in logical memory, outputs before inputs."""
        self.set_manager(slave, 2, OUTPUTS, sizes[0], 0x64)
        self.set_manager(slave, 3, INPUTS, sizes[1], 0x20)
        for number, (start, size, kind) in enumerate(
            ((OUTPUTS, sizes[0], 2), (INPUTS, sizes[1], 1))
        ):
            logical = 0x100 * slave + number * sizes[0]
            fmmu = struct.pack("<IHBBHBBB3x", logical, size, 0, 7, start, 0, kind, int(size > 0))
            self.write(slave, 0x600 + 16 * number, fmmu)
        assert self.request(slave, SAFEOP) == (SAFEOP, 0)

    def enter_op(self, *slaves: int, sizes: tuple[int, int] = (12, 12)) -> None:
        for slave in slaves:
            self.enter_preop(slave)
            self.enter_safeop(slave, sizes)
        for slave in slaves:
            assert self.request(slave, OP) == (OP, 0)

    def exchange(self, outputs: Sequence[bytes], size: int = 12) -> list[Answer]:
        """Exchange process data with slaves from the first on, a datagram each in one frame."""
        return self.send(
            *((Command.LRW, 0x100 * n, 0, data + bytes(size)) for n, data in enumerate(outputs))
        )

    # Mailbox and SDO

    def post(self, slave: int, service: bytes, kind: int = 3, counter: int | None = None) -> int:
        """Put a service into the mailbox; return the working counter."""
        if counter is None:
            counter = self._counters[slave] = self._counters.get(slave, 0) % 7 + 1
        content = struct.pack("<HHBB", len(service), 0, 0, kind | counter << 4) + service
        return self.write(slave, MAILBOX_OUT, content.ljust(self._size, b"\0"))

    def fetch(self, slave: int) -> bytes | None:
        """Return the content of the other mailbox with its header, or None if it is empty."""
        answer = self.read(slave, MAILBOX_IN, self._size)
        if not answer.counter:
            return None
        size = struct.unpack_from("<H", answer.data)[0]
        return answer.data[: 6 + size]

    def coe(self, slave: int, service: int, request: bytes) -> bytes:
        """Send a CoE request and return the answer after its two bytes of service."""
        assert self.post(slave, struct.pack("<H", service << 12) + request) == 1
        answer = self.fetch(slave)
        assert answer is not None
        return answer[8:]

    def _sdo(self, slave: int, request: bytes) -> bytes:
        answer = self.coe(slave, 2, request)
        if answer[0] == 0x80:
            raise SdoRefused(hex(struct.unpack_from("<I", answer, 4)[0]))
        return answer

    def upload(self, slave: int, index: int, subindex: int = 0, *, complete: bool = False) -> bytes:
        answer = self._sdo(slave, struct.pack("<BHBI", 0x40 | complete << 4, index, subindex, 0))
        if answer[0] & 2:
            return answer[4 : 8 - (answer[0] >> 2 & 3)]
        size, data, toggle = struct.unpack_from("<I", answer, 4)[0], answer[8:], 0
        while len(data) < size:
            part = self._sdo(slave, bytes([0x60 | toggle]) + bytes(7))
            data += part[1:] if len(part) > 8 else part[1 : 8 - (part[0] >> 1 & 7)]
            toggle ^= 0x10
        return data

    def download(
        self, slave: int, index: int, subindex: int, data: bytes, *, complete: bool = False
    ) -> None:
        flag = complete << 4
        if len(data) <= 4:
            command = 0x23 | flag | (4 - len(data)) << 2
            self._sdo(slave, struct.pack("<BHB", command, index, subindex) + data.ljust(4, b"\0"))
        else:
            head = struct.pack("<BHBI", 0x21 | flag, index, subindex, len(data))
            self._sdo(slave, head + data)
