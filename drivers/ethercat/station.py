"""One slave on the line by the address that we gave it: its registers and its AL state."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from drivers.drive_bus import DriveRefused
from drivers.ethercat import registers as reg
from drivers.ethercat.al_states import ACKNOWLEDGE, ERROR, MASK, AlState, shown
from drivers.ethercat.frames import Command, Datagram, at
from drivers.remote_dictionary import NoAnswer

if TYPE_CHECKING:
    from drivers.ethercat.line import Line

FIRST_ADDRESS = 0x1001
"""Address that the first slave is given; those behind it follow."""
STATE_TIME = 3.0
"""How long a slave may take from one AL state to the next [s]; SOEM waits 2."""
WHERE = "its place on the line, the cables and that no other master is on the line"
"""What to check where a slave does not answer."""


class Station:
    """One slave.

    Parameters
    ----------
    line : Line
        That it is on.
    position : int
        From 1.

    Attributes
    ----------
    position, address : int
    """

    def __init__(self, line: Line, position: int) -> None:
        self.line, self.position = line, position
        self.address = FIRST_ADDRESS + position - 1

    def find(self) -> None:
        """Give the slave its address.

        Raises
        ------
        NoAnswer
            None is at this position.
        """
        place, address = at(1 - self.position, reg.STATION), self.address.to_bytes(2, "little")
        if self.line.ask(Datagram(Command.APWR, place, address))[0].counter != 1:
            raise NoAnswer("no working counter", WHERE)

    def read(self, place: int, size: int) -> bytes:
        """Read registers.

        Raises
        ------
        NoAnswer
            The slave is gone.
        BusUnavailable
            No frame comes back.
        """
        answer = self.line.ask(Datagram(Command.FPRD, at(self.address, place), bytes(size)))[0]
        if answer.counter != 1:
            raise NoAnswer("no working counter", WHERE)
        return answer.data

    def word(self, place: int) -> int:
        """Read a register of 16 bits (errors as in `read`)."""
        return int.from_bytes(self.read(place, 2), "little")

    def write(self, place: int, data: bytes) -> None:
        """Write registers (errors as in `read`)."""
        if self.line.ask(Datagram(Command.FPWR, at(self.address, place), data))[0].counter != 1:
            raise NoAnswer("no working counter", WHERE)

    def put_word(self, place: int, value: int) -> None:
        """Write a register of 16 bits (errors as in `read`)."""
        self.write(place, value.to_bytes(2, "little"))

    @property
    def status(self) -> int:
        """AL status: state and error bit (errors as in `read`)."""
        return self.word(reg.AL_STATUS)

    @property
    def state(self) -> int:
        """AL state, an `AlState` of any slave that keeps to the standard (errors as in `read`)."""
        return self.status & MASK

    @property
    def shown(self) -> str:
        """AL state and its error in words (errors as in `read`)."""
        return shown(self.status, self.word(reg.AL_CODE))

    def ask_for(self, state: AlState) -> None:
        """Ask for an AL state, acknowledging an error, and await nothing (errors as in `read`)."""
        flag = ACKNOWLEDGE if self.status & ERROR else 0
        self.put_word(reg.AL_CONTROL, state | flag)

    def go(self, state: AlState) -> None:
        """Bring the slave into an AL state.

        Raises
        ------
        DriveRefused
            It refuses, or does not get there, with its AL status code.
        NoAnswer, BusUnavailable
            As in `read`.
        """
        self.ask_for(state)
        ends = time.monotonic() + STATE_TIME
        while (status := self.status) & MASK != state or status & ERROR:
            if status & ERROR or time.monotonic() > ends:
                raise DriveRefused(
                    f"slave {self.position}: shows {self.shown}, {state.name} was asked for; see"
                    " the drive's manual for this AL status code"
                )
            self.line.pause()
