"""Leaving: axes stopped and off, drives as they were found, the bus as it was.

What goes wrong at one step keeps no other from being taken. Settings are put back, and with them
watchdogs released, for those drives alone that have shown that they are off.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from drivers.cia402.deadline import Deadline
from drivers.drive_bus import Tripped
from drivers.session.session import SessionState

if TYPE_CHECKING:
    from drivers.found_settings.keeping import SettingsKeeper
    from drivers.found_settings.restoring import RestoringOrder
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Connection
    from drivers.session.session import Session

RESTORING = 20.0
"""For how long at most settings are put back on leaving [s]; `hil drives restore` does the rest."""


@dataclass
class Outcome:
    """What became of the drives.

    Attributes
    ----------
    off : set of RemoteDictionary
        Drives that have shown that they are off.
    complete : bool
        All to which something may have been written are.
    problems, notes : list of str
        What went wrong; what the operator should know beside that.
    """

    off: set[RemoteDictionary] = field(default_factory=set)
    complete: bool = True
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def message(self) -> str:
        """The problems in one line; empty where there are none."""
        if not self.problems:
            return ""
        incomplete = "" if self.complete else " is incomplete, press the emergency stop"
        return f"powering off{incomplete}: {'; '.join(self.problems)}"


def leave(
    connection: Connection,
    session: Session | None,
    keeper: SettingsKeeper,
    order: RestoringOrder,
) -> Outcome:
    """Stop and switch off all drives, put back what they held, and take our part off the bus.

    Parameters
    ----------
    connection : Connection
        To the drives.
    session : Session, optional
        None where not all drives were configured.
    keeper : SettingsKeeper
        Knows what they held.
    order : RestoringOrder
        Of the bus.
    """
    outcome = Outcome()
    if session is not None and session.state is not SessionState.CHECKED:
        _switch_off_running(session, outcome)
    else:
        _switch_off_unpowered(connection, outcome)
    trouble = connection.life_sign.trouble
    if session is not None and isinstance(trouble, Tripped) and trouble != session.stopping.trip:
        outcome.notes.append(str(trouble))  # somebody else's command, with an interrupt or after it
    outcome.complete = set(connection.written) <= outcome.off
    _restore(connection, keeper, order, outcome)
    try:
        outcome.notes += keeper.close(connection.servers, connection.written)
    except FileError as error:  # the axes are off, and what was kept before is on the disk
        outcome.notes.append(str(error))
    return outcome


def _switch_off_running(session: Session, outcome: Outcome) -> None:
    stopping = session.stopping
    stopping.stop()
    stopping.switch_off()
    outcome.notes += stopping.conclude()
    if all(stopping.off):  # by now also a slow drive has renewed its current
        with suppress(Exception):
            session.note_offsets("after power-off")
    servers = session.connection.servers
    outcome.off = {server for server, off in zip(servers, stopping.off, strict=True) if off}
    outcome.problems += stopping.problems


def _switch_off_unpowered(connection: Connection, outcome: Outcome) -> None:
    """Switch off drives of which no process data come yet, and which were never energised."""
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
    # axes of one node share what watches them
    on = {server.node for server in connection.written if server not in outcome.off}
    for server in connection.written:
        if server.node not in on and not over.passed:
            try:
                keeper.restore(server, order)
            except Exception as error:  # what is not put back is reported by `SettingsKeeper.close`
                outcome.notes.append(str(error))
