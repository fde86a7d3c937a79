"""Mailboxes of a slave (ETG.1000.4 clause 5.6): services, answers and emergencies.

The master's counter runs from 1 to 7, so that the slave drops a service that arrives twice because
the frame with its working counter was lost. A lost answer is requested again with the repeat bit.
"""

from __future__ import annotations

import struct
import time
from typing import TYPE_CHECKING

from drivers.ethercat import registers as reg
from drivers.ethercat.line import ATTEMPTS, Command, Datagram, address_of
from drivers.ethercat.slaves import WHERE
from drivers.remote_dictionary import NoAnswer

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
        raise NoAnswer(f"{WAITING} services came, none is the answer", _WHERE)

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
        """Receive waiting services without waiting for more (errors as in `exchange`)."""
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
            raise NoAnswer(f"its mailbox was lost on the way {ATTEMPTS} times", WHERE)
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
