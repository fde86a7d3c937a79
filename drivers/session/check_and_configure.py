"""Check and configuration of all drives: every drive must pass before any is written to.

Each drive is switched off and examined in turn, and the values that start-up will write are
determined (`announcement`). A failure does not keep the others from being examined, so that the
operator gets all messages at once. Only when all have passed and their values have been saved
(`found_settings.keeping`) are they configured (`configure`).
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, TypeVar

from drivers.axis import Axis
from drivers.cia402.states import Mode
from drivers.commissioning.announcement import announce
from drivers.commissioning.configure import commission, find_swap
from drivers.commissioning.effective_limits import effective_limits
from drivers.drive_bus import DriveError, DriveFault, DriveRefused, NodeSilent, join_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from drivers.commissioning.announcement import Announcement
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.found_settings.keeping import SettingsKeeper
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Connection

_Result = TypeVar("_Result")


def check_and_configure(
    connection: Connection,
    drives: DrivesFile,
    period: float,
    keeper: SettingsKeeper,
    *,
    reset_faults: bool,
) -> tuple[Axis, ...]:
    """Check and configure all drives; they stay off, without process data.

    Parameters
    ----------
    connection : Connection
        Connection to the drives; a drive is added to `written` before its first write.
    drives : DrivesFile
    period : float
        Time between two SYNCs [s].
    keeper : SettingsKeeper
        Saves the present values.
    reset_faults : bool
        True to reset drives found in a fault.

    Returns
    -------
    tuple of Axis
        Axes with the limits in force.

    Raises
    ------
    DriveRefused, NodeSilent, DriveFault
        Unsuitable drives, a line each.
    FileError
        The present values cannot be saved; nothing was written.
    """
    keeper.open(drives)
    servers, communications = connection.servers, connection.communications
    pairs = list(zip(servers, drives.axes, strict=True))
    at = {server: place for place, server in enumerate(servers)}

    def look(server: RemoteDictionary, axis: AxisDrive) -> Announcement:
        server.access.leave_operational()
        connection.power.make_safe(server, reset_fault=reset_faults)
        held, communication = partial(keeper.found, server), communications[at[server]]
        try:
            announcement = announce(server, axis, drives, period, communication, held, keeper.later)
        except DriveRefused as error:
            # node numbers may be swapped: then the remedy is to swap them back
            swap = find_swap(server, axis, pairs)
            if swap is None:
                raise
            raise DriveRefused(f"{str(error).rsplit('; ', 1)[0]}; {swap}") from error
        planned = {change.entry: change.value for change in announcement.changes}
        keeper.take(server, axis, announcement.found, planned)
        return announcement

    expected = tuple(each.limits for each in _visit_all(look, pairs))
    keeper.announce(servers)

    def configure(server: RemoteDictionary, axis: AxisDrive) -> Axis:
        place = at[server]
        connection.written.append(server)
        holding, communication = expected[place], communications[place]
        wait = connection.power.wait
        identity, mode = commission(server, axis, drives, period, wait, holding, communication)

        def find(entry: Entry) -> int | None:  # a drive may keep a tighter value than ours
            if entry in server.missing:
                return None
            return server.kept.get(entry, holding.values.get(entry))

        held = effective_limits(find, axis, server.label)
        return Axis(
            place,
            axis,
            held.apply_to(axis),
            server,
            own={**held.own, **holding.own},
            stop_deceleration=held.stop_deceleration,
            identity=identity,
            planned=mode is not Mode.PROFILE_POSITION,
            wrap=holding.wrap,
        )

    configured = _visit_all(configure, pairs)
    conflicts = connection.conflicts()
    if conflicts:
        raise join_errors(conflicts)
    keeper.confirm(servers)
    return tuple(configured)


def _visit_all(
    step: Callable[[RemoteDictionary, AxisDrive], _Result],
    pairs: Iterable[tuple[RemoteDictionary, AxisDrive]],
) -> list[_Result]:
    """Take a step with each drive, and raise failures only at the end."""
    problems: list[DriveError] = []
    results = []
    for server, axis in pairs:
        try:
            results.append(step(server, axis))
        except (DriveRefused, NodeSilent, DriveFault) as error:
            problems.append(error)
    if problems:
        raise problems[0] if len(problems) == 1 else join_errors(problems)
    return results
