"""Process data begin: all drives become operational, and each must answer SYNC."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.life_guarding import guarding_request
from drivers.drive_bus import NodeSilent

if TYPE_CHECKING:
    from drivers.session.connection import Connection

FIRST_ANSWERS = 1.0
"""How long drives may take to answer each SYNC once they are operational [s]."""


def listen_as_found(connection: Connection) -> None:
    """Expect TPDOs, emergencies and guarding of each drive as it has been set up."""
    found = connection.communications
    connection.process_data.wire(found)
    connection.emergencies.listen([drive.emergency for drive in found])
    connection.heartbeats.requests = [
        guarding_request(drive.node) for drive in found if drive.guarded
    ]


def await_answers(connection: Connection) -> None:
    """Watch drives that have just become operational, until each answers SYNC.

    Raises
    ------
    NodeSilent
        Which do not, or whose heartbeat stays away.
    """
    clock, data = connection.clock, connection.process_data
    connection.heartbeats.watch()
    connection.heartbeats.hurry()  # a drive watches from the first heartbeat on, not before
    connection.supervision.forget()
    ends = clock.now() + FIRST_ANSWERS
    connection.cycle()
    while data.irregular:
        if clock.now() > ends:
            pairs = zip(connection.servers, data.flags, strict=True)
            silent = [server.label for server, flag in pairs if flag]
            raise NodeSilent(
                f"{'; '.join(silent)}: does not answer each SYNC with one TPDO of the mapped "
                "length; check that no other master is on the bus, and the bus load"
            )
        connection.cycle()
