"""Slaves on the line, by position or alias: registers and AL states."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from drivers.drive_bus import BusUnavailable, DriveRefused
from drivers.ethercat import registers as reg
from drivers.ethercat.line import Command, Datagram, address_of
from drivers.ethercat.registers import ACKNOWLEDGE, ERROR, MASK, AlState, describe
from drivers.remote_dictionary import NoAnswer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.ethercat.line import Line


FIRST_ADDRESS = 0x1001
"""Station address of the first slave; those of the others follow."""
STATE_TIME = 3.0
"""Longest time of a slave between two AL states [s]; SOEM waits 2."""
WHERE = "its place on the line, the cables and that no other master is on the line"
"""Checks for a slave that does not answer."""


class Station:
    """Slave on the line.

    Parameters
    ----------
    line : Line
    position : int
        Position on the line, from 1.

    Attributes
    ----------
    position, address : int
    """

    def __init__(self, line: Line, position: int) -> None:
        self.line, self.position = line, position
        self.address = FIRST_ADDRESS + position - 1

    def find(self) -> None:
        """Assign the station address.

        Raises
        ------
        NoAnswer
            There is no slave at this position.
        """
        place = address_of(1 - self.position, reg.STATION)
        address = self.address.to_bytes(2, "little")
        if self.line.ask(Datagram(Command.APWR, place, address))[0].counter != 1:
            raise NoAnswer("no working counter", WHERE)

    def read(self, place: int, size: int) -> bytes:
        """Read registers.

        Raises
        ------
        NoAnswer
            The slave is gone.
        BusUnavailable
            No frame returns.
        """
        place = address_of(self.address, place)
        answer = self.line.ask(Datagram(Command.FPRD, place, bytes(size)))[0]
        if answer.counter != 1:
            raise NoAnswer("no working counter", WHERE)
        return answer.data

    def word(self, place: int) -> int:
        """Read a register of 16 bits (errors as in `read`)."""
        return int.from_bytes(self.read(place, 2), "little")

    def write(self, place: int, data: bytes) -> None:
        """Write registers (errors as in `read`)."""
        place = address_of(self.address, place)
        if self.line.ask(Datagram(Command.FPWR, place, data))[0].counter != 1:
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
        """AL state, an `AlState` in slaves that conform to the standard (errors as in `read`)."""
        return self.status & MASK

    @property
    def shown(self) -> str:
        """AL state and its error in words (errors as in `read`)."""
        return describe(self.status, self.word(reg.AL_CODE))

    def ask_for(self, state: AlState) -> None:
        """Request an AL state, acknowledge an error, and do not wait (errors as in `read`)."""
        flag = ACKNOWLEDGE if self.status & ERROR else 0
        self.put_word(reg.AL_CONTROL, state | flag)

    def go(self, state: AlState) -> None:
        """Bring the slave into an AL state.

        Raises
        ------
        DriveRefused
            The slave refuses, or does not reach the state, with its AL status code.
        NoAnswer, BusUnavailable
            As in `read`.
        """
        self.ask_for(state)
        ends = time.monotonic() + STATE_TIME
        while (status := self.status) & MASK != state or status & ERROR:
            if status & ERROR or time.monotonic() > ends:
                raise DriveRefused(
                    f"slave {self.position}: shows {self.shown}, {state.name} was requested; see "
                    "the drive's manual for this AL status code"
                )
            self.line.pause()


LISTENING = 0.1
"""Duration of listening for another master if a drive is in OP [s]: some cycles of any master."""


class Slaves:
    """Slaves on a line, which get addresses at the first access.

    Parameters
    ----------
    line : Line
    """

    def __init__(self, line: Line) -> None:
        self._line = line
        self._found: tuple[Station, ...] | None = None
        self._aliases: list[int] = []

    @property
    def all(self) -> Sequence[Station]:
        """Slaves in order of position.

        Raises
        ------
        BusUnavailable
            No frame returns, or another master is at work.
        NoAnswer
            A slave has gone meanwhile.
        """
        if self._found is None:
            states = self._line.read_all(reg.AL_STATUS, 2)
            if states.counter and states.data[0] & MASK & AlState.OP:
                ends = time.monotonic() + LISTENING
                while (left := ends - time.monotonic()) > 0:
                    self._line.receive(left)
                if self._line.foreign:
                    raise BusUnavailable(
                        "another master exchanges process data on this interface; end it first"
                    )
            found = tuple(Station(self._line, n) for n in range(1, states.counter + 1))
            for station in found:
                station.find()
            self._aliases = [station.word(reg.ALIAS) for station in found]
            self._found = found
        return self._found

    def find(self, position: int, alias: int | None) -> Station:
        """Return the slave with an alias, or at a position if no alias is stated.

        Raises
        ------
        DriveRefused
            Two slaves have the alias.
        NoAnswer, BusUnavailable
            The slave is not there; see `all`.
        """
        found = self.all
        if alias is None:
            if position > len(found):
                raise NoAnswer(f"{len(found)} slaves are on the line", WHERE)
            return found[position - 1]
        named = [s for s, own in zip(found, self._aliases, strict=True) if own == alias]
        if not named:
            aliases = ", ".join(map(str, self._aliases)) or "none"
            raise NoAnswer(f"no slave has alias {alias}, they have {aliases}", WHERE)
        if len(named) > 1:
            places = ", ".join(str(station.position) for station in named)
            raise DriveRefused(
                f"slaves {places} on the line have the same alias {alias}; give each its own with"
                " the maker's tool"
            )
        return named[0]
