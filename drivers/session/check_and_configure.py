"""All or nothing: every drive must pass before any is energised, or even written to.

Each drive is switched off and looked at in turn, and what start-up will write to it is found out
(`announcement`). One that fails does not keep the others from being looked at, so that the operator
learns at once what to mend. Only when all have passed, and what they hold has been kept
(`found_settings.keeping`), are they configured (`configure`).
"""

from __future__ import annotations

from dataclasses import replace
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
    from drivers.commissioning.effective_limits import EffectiveLimits
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
    """Check and configure all drives, leaving them off and exchanging no process data.

    Parameters
    ----------
    connection : Connection
        To the drives; `written` grows by each as soon as something may have been written to it.
    drives : DrivesFile
        What is stated of them.
    period : float
        Time between two SYNCs [s].
    keeper : SettingsKeeper
        Keeps what they hold before that.
    reset_faults : bool
        Reset drives that are found in a fault.

    Returns
    -------
    tuple of Axis
        With the limits that hold.

    Raises
    ------
    DriveRefused, NodeSilent, DriveFault
        Why drives cannot serve, a line each.
    FileError
        What they hold cannot be kept; nothing was written.
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
            raise _explained(error, server, axis, pairs) from error
        planned = {change.entry: change.value for change in announcement.changes}
        keeper.take(server, axis, announcement.found, planned)
        return announcement

    expected = tuple(each.limits for each in _all(look, pairs))
    keeper.announced(servers)

    def configure(server: RemoteDictionary, axis: AxisDrive) -> Axis:
        place = at[server]
        connection.written.append(server)
        holding, communication = expected[place], communications[place]
        wait = connection.power.wait
        identity, mode = commission(server, axis, drives, period, wait, holding, communication)
        held = _held(server, axis, holding)
        return Axis(
            place,
            axis,
            held.apply_to(axis),
            server,
            own=held.own,
            stop_deceleration=held.stop_deceleration,
            identity=identity,
            planned=mode is not Mode.PROFILE_POSITION,
            wrap=holding.wrap,
        )

    configured = _all(configure, pairs)
    conflicts = connection.conflicts()
    if conflicts:
        raise join_errors(conflicts)
    keeper.configured(servers)
    return tuple(configured)


def _explained(
    error: DriveRefused,
    server: RemoteDictionary,
    axis: AxisDrive,
    pairs: Iterable[tuple[RemoteDictionary, AxisDrive]],
) -> DriveRefused:
    """Give an error of a drive that is another axis's that remedy in place of its own."""
    other = find_swap(server, axis, pairs)
    return error if other is None else DriveRefused(f"{str(error).rsplit('; ', 1)[0]}; {other}")


def _held(server: RemoteDictionary, axis: AxisDrive, expected: EffectiveLimits) -> EffectiveLimits:
    """Return the limits that hold now: a drive may keep a tighter value than was written."""

    def find(entry: Entry) -> int | None:
        if entry in server.missing:
            return None
        return server.kept.get(entry, expected.values.get(entry))

    kept = effective_limits(find, axis, server.label)
    return replace(kept, own={**kept.own, **expected.own}, notes=())


def _all(
    step: Callable[[RemoteDictionary, AxisDrive], _Result],
    pairs: Iterable[tuple[RemoteDictionary, AxisDrive]],
) -> list[_Result]:
    """Take a step with each drive, and only then raise what went wrong."""
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
