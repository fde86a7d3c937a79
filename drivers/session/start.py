"""Process data begin: all drives become operational, and each must answer SYNC.

A drive may take its time from NMT start to OPERATIONAL, or lose the command: it is repeated until
the drive answers SYNC, which only an operational one does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.heartbeat import START_TIME
from drivers.canopen.life_guarding import guarding_request
from drivers.drive_bus import NodeSilent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.canopen.sdo import RemoteDictionary
    from drivers.session.connection import Connection

START_AGAIN = 0.1
"""Time after which a drive that does not answer SYNC is commanded to start again [s]."""


def listen_as_found(connection: Connection) -> None:
    """Expect TPDOs, emergencies and guarding of each drive as it has been set up."""
    found = connection.communications
    connection.process_data.wire([drive.transmitted for drive in found])
    connection.emergencies.listen([drive.emergency for drive in found])
    connection.heartbeats.requests = [
        guarding_request(drive.node) for drive in found if drive.guarded
    ]


def await_answers(connection: Connection) -> None:
    """Watch drives that have just been commanded to start, until each answers SYNC.

    Raises
    ------
    NodeSilent
        Which do not, or whose heartbeat stays away.
    """
    clock, data, heartbeats = connection.clock, connection.process_data, connection.heartbeats
    heartbeats.watch(starting=True)
    heartbeats.hurry()  # a drive watches from the first heartbeat on, not before
    connection.supervision.forget()
    begun = clock.now()
    again = begun + START_AGAIN
    connection.cycle()
    while data.irregular:
        pairs = zip(connection.servers, data.flags, strict=True)
        silent = [server for server, flag in pairs if flag]
        if clock.now() > begun + START_TIME:
            raise _silence(silent, heartbeats.starting)
        if clock.now() > again:
            for server in silent:
                server.enter_operational()
            again = clock.now() + START_AGAIN
        connection.cycle()


def _silence(silent: Sequence[RemoteDictionary], starting: set[int]) -> NodeSilent:
    labels = "; ".join(server.label for server in silent)
    if all(server.node in starting for server in silent):
        return NodeSilent(
            f"{labels}: not operational {START_TIME:g} s after NMT start, which was repeated; check"
            " the drive's supply and state, and that no other master is on the bus"
        )
    return NodeSilent(
        f"{labels}: does not answer each SYNC with one TPDO of the mapped length; check that no"
        " other master is on the bus, and the bus load"
    )
