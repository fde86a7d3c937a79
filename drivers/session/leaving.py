"""End of a session: axes stopped and off, drives restored, the bus released.

A failure of one step does not prevent the others. Settings are restored, and thus watchdogs
released, only for drives with confirmed power-off.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from drivers.cia402.power import Deadline
from drivers.drive_bus import Tripped
from drivers.session.session import SessionState

if TYPE_CHECKING:
    from drivers.found_settings.keeping import SettingsKeeper
    from drivers.found_settings.restoring import RestoringOrder
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Connection
    from drivers.session.session import Session

RESTORING = 20.0
"""Longest time for restoring at the end [s]; `hil drives restore` does the rest."""


@dataclass
class Outcome:
    """State of the drives after a session.

    Attributes
    ----------
    off : set of RemoteDictionary
        Drives with confirmed power-off.
    complete : bool
        True if every drive that may have been written to is off.
    problems, notes : list of str
        Failures; further messages for the operator.
    """

    off: set[RemoteDictionary] = field(default_factory=set)
    complete: bool = True
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def message(self) -> str:
        """Failures in a line; empty if there are none."""
        if not self.problems:
            return ""
        incomplete = "" if self.complete else " is incomplete, press the emergency stop"
        return f"powering off{incomplete}: {'; '.join(self.problems)}"


def leave(
    connection: Connection, session: Session | None, keeper: SettingsKeeper, order: RestoringOrder
) -> Outcome:
    """Stop and switch off the drives, restore their settings, and release the bus.

    Parameters
    ----------
    connection : Connection
        Connection to the drives.
    session : Session, optional
        None if not all drives were configured.
    keeper : SettingsKeeper
        Saved settings.
    order : RestoringOrder
        Order of restoring on the bus.
    """
    outcome = Outcome()
    if session is not None and session.state is not SessionState.CHECKED:
        _switch_off_running(session, outcome)
    else:
        _switch_off_unpowered(connection, outcome)
    trouble = connection.life_sign.trouble
    if session is not None and isinstance(trouble, Tripped) and trouble != session.stopping.trip:
        outcome.notes.append(str(trouble))  # a foreign command with an interrupt, or after it
    outcome.complete = set(connection.written) <= outcome.off
    _restore(connection, keeper, order, outcome)
    try:
        outcome.notes += keeper.close(connection.servers, connection.written)
    except FileError as error:  # the axes are off, and earlier values are on the disk
        outcome.notes.append(str(error))
    return outcome


def _switch_off_running(session: Session, outcome: Outcome) -> None:
    stopping = session.stopping
    stopping.stop()
    stopping.switch_off()
    outcome.notes += stopping.conclude()
    if all(stopping.off):  # by now even a slow drive has refreshed its current
        with suppress(Exception):
            session.note_offsets("after power-off")
    servers = session.connection.servers
    outcome.off = {server for server, off in zip(servers, stopping.off, strict=True) if off}
    outcome.problems += stopping.problems


def _switch_off_unpowered(connection: Connection, outcome: Outcome) -> None:
    """Switch off drives without process data, which were never energised."""
    for server in connection.written:
        try:
            connection.power.switch_off(server)
            outcome.off.add(server)
        except Exception as error:
            connection.life_sign.cease()
            outcome.problems.append(
                f"{server.label}: not shown to be off ({error}); its watchdog stays armed and "
                f"{connection.life_sign.name} has ceased"
            )


def _restore(
    connection: Connection, keeper: SettingsKeeper, order: RestoringOrder, outcome: Outcome
) -> None:
    over = Deadline(RESTORING)
    # axes of one node share its supervision of the master
    on = {server.node for server in connection.written if server not in outcome.off}
    for server in connection.written:
        if server.node not in on and not over.passed:
            try:
                keeper.restore(server, order)
            except Exception as error:  # `SettingsKeeper.close` reports drives not restored
                outcome.notes.append(str(error))
