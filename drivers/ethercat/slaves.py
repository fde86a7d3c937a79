"""Slaves on the line, by position, from 1, or by alias."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from drivers.drive_bus import BusUnavailable, DriveRefused
from drivers.ethercat import registers as reg
from drivers.ethercat.al_states import MASK, AlState
from drivers.ethercat.station import WHERE, Station
from drivers.remote_dictionary import NoAnswer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.ethercat.line import Line

LISTENING = 0.1
"""Duration of listening for another master if a drive is in OP [s]: some cycles of any."""


class Slaves:
    """Slaves on a line, which get addresses at the first access.

    Parameters
    ----------
    line : Line
        Line of the slaves.
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
