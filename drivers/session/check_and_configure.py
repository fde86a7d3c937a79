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

from drivers.axis import AxisScale
from drivers.canopen.communication import find_collisions
from drivers.commissioning.announcement import announce
from drivers.commissioning.configure import commission
from drivers.commissioning.effective_limits import effective_limits
from drivers.commissioning.mix_up import mixed_up
from drivers.drive_bus import AxisInfo, DriveError, DriveFault, DriveRefused, NodeSilent

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from drivers.canopen.communication import Communication
    from drivers.canopen.sdo import RemoteDictionary
    from drivers.cia402.power import Power
    from drivers.commissioning.announcement import Announcement
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.found_settings.keeping import SettingsKeeper

_Result = TypeVar("_Result")


def check_and_configure(
    servers: Sequence[RemoteDictionary],
    drives: DrivesFile,
    period: float,
    power: Power,
    commissioned: list[RemoteDictionary],
    communications: Sequence[Communication],
    keeper: SettingsKeeper,
    *,
    reset_faults: bool,
) -> tuple[tuple[AxisInfo, ...], tuple[EffectiveLimits, ...]]:
    """Check and configure all drives, leaving them off and pre-operational.

    Parameters
    ----------
    servers : sequence of RemoteDictionary
        The drives in joint order.
    drives : DrivesFile
        What is stated of them.
    period : float
        Time between two SYNCs [s].
    power : Power
        Switches them off first.
    commissioned : list of RemoteDictionary
        Extended by each drive as soon as something may have been written to it.
    communications : sequence of Communication
        By drive; what is found is put in.
    keeper : SettingsKeeper
        Keeps what they hold before that.
    reset_faults : bool
        Reset drives that are found in a fault.

    Returns
    -------
    tuple of AxisInfo, tuple of EffectiveLimits
        What the drives are, and which limits hold.

    Raises
    ------
    DriveRefused, NodeSilent, DriveFault
        Why drives cannot serve, a line each.
    FileError
        What they hold cannot be kept; nothing was written.
    """
    keeper.open(drives)
    pairs = list(zip(servers, drives.axes, strict=True))
    at = {server.node: place for place, server in enumerate(servers)}

    def look(server: RemoteDictionary, axis: AxisDrive) -> Announcement:
        server.enter_pre_operational()
        power.make_safe(server, reset_fault=reset_faults)
        held = partial(keeper.found, server)
        feeds = communications[at[server.node]].feed_forward
        try:
            announcement = announce(
                server, axis, drives, period, held, keeper.later, feed_forward=feeds
            )
        except DriveRefused as error:
            raise _explained(error, server, axis, pairs) from error
        planned = {change.entry: change.value for change in announcement.changes}
        keeper.take(server, axis, announcement.found, planned)
        return announcement

    expected = tuple(each.limits for each in _all(look, pairs))
    keeper.announced(servers)

    def configure(server: RemoteDictionary, axis: AxisDrive) -> tuple[AxisInfo, EffectiveLimits]:
        place = at[server.node]
        commissioned.append(server)
        holding, communication = expected[place], communications[place]
        identity = commission(server, axis, drives, period, power.wait, holding, communication)
        held = _held(server, axis, holding)
        return _described(axis, identity, held), held

    configured = _all(configure, pairs)
    collisions = find_collisions(communications, drives.master_node)
    if collisions:
        raise _joined(collisions)
    keeper.configured(servers)
    return tuple(info for info, _ in configured), tuple(held for _, held in configured)


def _explained(
    error: DriveRefused,
    server: RemoteDictionary,
    axis: AxisDrive,
    pairs: Iterable[tuple[RemoteDictionary, AxisDrive]],
) -> DriveRefused:
    """Give an error of a drive that is another axis's that remedy in place of its own."""
    other = mixed_up(server, axis, pairs)
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
        raise _joined(problems)
    return results


def _described(axis: AxisDrive, identity: str, holding: EffectiveLimits) -> AxisInfo:
    scale, limits = AxisScale.of(axis), holding.limits
    return AxisInfo(
        name=axis.name,
        identity=identity,
        q_min=limits.q_min,
        q_max=limits.q_max,
        velocity_max=limits.velocity,
        acceleration_max=limits.acceleration,
        torque_resolution=abs(scale.torque),
        position_resolution=abs(scale.position),
        own_limits=holding.own,
        unit=axis.unit,
    )


def _joined(problems: Sequence[DriveError]) -> DriveError:
    if len(problems) == 1:
        return problems[0]
    silent = all(isinstance(problem, NodeSilent) for problem in problems)
    return (NodeSilent if silent else DriveRefused)("\n".join(map(str, problems)))
