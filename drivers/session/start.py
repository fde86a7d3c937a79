"""Process data begin: all drives become operational, and each must answer SYNC.

A drive may take its time from NMT start to OPERATIONAL, or lose the command: it is repeated until
the drive answers SYNC, which only an operational one does. Right before power-on the watch on us
must be as it was set, and every axis inside its limits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.canopen.heartbeat import START_TIME
from drivers.canopen.life_guarding import guarding_request
from drivers.drive_bus import DriveRefused, LimitExceeded, NodeSilent
from drivers.found_settings.restoring import WATCHDOGS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from drivers.canopen.sdo import RemoteDictionary
    from drivers.drives_file import AxisDrive
    from drivers.session.connection import Connection

START_AGAIN = 0.1
"""Time after which a drive that does not answer SYNC is commanded to start again [s]."""


def listen_as_found(connection: Connection) -> None:
    """Expect TPDOs, emergencies and guarding of each drive as it has been set up."""
    found = connection.communications
    connection.process_data.wire(found)
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


def refuse_unwatched(servers: Iterable[RemoteDictionary]) -> None:
    """Refuse drives whose watch on us is not as it was set: another master may be at work.

    Raises
    ------
    DriveRefused
        The first of them, with what it holds and what was written.
    """
    for server in servers:
        for entry, value in server.kept.items():
            if entry.index in WATCHDOGS and (present := server.get(entry)) != value:
                raise DriveRefused(
                    f"{server.label}: {entry} is {present} before power-on, {value} was "
                    "written; another master or a restore changed it: end that first"
                )


def refuse_outside(axes: Sequence[AxisDrive], positions: Sequence[int]) -> None:
    """Refuse axes that stand where they must never be, before any is energised.

    Parameters
    ----------
    axes : sequence of AxisDrive
        With the limits that hold.
    positions : sequence of int
        Where they stand [increments].

    Raises
    ------
    LimitExceeded
        A line for each that is outside.
    """
    outside = []
    for axis, counts in zip(axes, positions, strict=True):
        q, limits, slack = (
            AxisScale.of(axis).position_from_counts(counts),
            axis.limits,
            axis.position_window,
        )
        if not limits.q_min - slack <= q <= limits.q_max + slack:
            unit = axis.unit
            outside.append(
                f"{axis.label}: stands at {q:.4g} {unit}, must be in "
                f"[{limits.q_min:g}, {limits.q_max:g}] {unit}; bring it back without power or "
                "with the maker's tool, or correct zero, sign or limits in the drives file"
            )
    if outside:
        raise LimitExceeded("\n".join(outside))
