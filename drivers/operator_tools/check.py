"""`hil check`: whether what the drives file states is true of the drives on the bus.

It goes from harmless to less so. First the drives are asked by SDO, unpowered, and nothing is
written. If that refuses any, it ends there. Then, with the operator's consent, all are configured
and powered as for a run and hold their position; then each axis in turn goes a few degrees there
and back, slowly and watched (`check_powered`). At the end all are switched off and must stay where
they are, which is what brakes are for. Verdicts come as they are found.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.canopen.bus_load import MAX_LOAD, cycle_time
from drivers.canopen.sdo import SDO_TIMEOUT, RemoteDictionary
from drivers.cia402 import objects
from drivers.cia402.supervision import Supervision
from drivers.commissioning.announcement import announce
from drivers.commissioning.configure import check_identity
from drivers.commissioning.consistency import GEAR, POSITION
from drivers.commissioning.mix_up import fits, mixed_up
from drivers.commissioning.ratings import CURRENT, TORQUE
from drivers.commissioning.verdict import Grade, Verdict, graded, refused
from drivers.dictionary.live import read_dictionary
from drivers.dictionary.review import review
from drivers.drive_bus import DriveError, DriveRefused, NodeSilent
from drivers.found_settings.keeping import SettingsKeeper
from drivers.operator_tools.check_limits import check_limits
from drivers.operator_tools.check_powered import REST_TIME, check_powered, shown_way
from drivers.operator_tools.check_reactions import check_reactions
from drivers.operator_tools.check_scaling import check_scaling
from drivers.operator_tools.operator import require_consent
from drivers.operator_tools.reset_faults import check_state
from drivers.operator_tools.scan import NODES, scan_bus
from drivers.operator_tools.unpowered import UnpoweredDrives

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence

    import can

    from drivers.canopen.network import PumpedNetwork
    from drivers.canopen.sync_clock import PacingName
    from drivers.dictionary.dictionary import Dictionary
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.operator_tools.check_gravity import Gravity
    from drivers.operator_tools.check_powered import SmallMoves
    from drivers.operator_tools.operator import Operator

IDENTITY = "identity (1018)"
_BY_NODE = frozenset({IDENTITY, CURRENT, TORQUE, POSITION, GEAR})
"""Checks that also fail where node numbers are mixed up."""


def check(
    bus: can.BusABC,
    drives: DrivesFile,
    moves: SmallMoves,
    operator: Operator,
    pacing: PacingName = "auto",
    keeper: SettingsKeeper | None = None,
    gravity: Gravity | None = None,
) -> Generator[Verdict, None, None]:
    """Check every axis of a drives file on a live bus.

    Parameters
    ----------
    bus : can.BusABC
        An open bus.
    drives : DrivesFile
        The axes to check, in joint order.
    moves : SmallMoves
        How far and how fast.
    operator : Operator
        Who agrees to motion, can stop it, and is asked which way it went.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.canopen.sync_clock.choose_sync_clock`.
    keeper : SettingsKeeper, optional
        See `drivers.canopen_bus.CanopenDriveBus`.
    gravity : callable, optional
        Torques that hold all axes of `drives` at rest [N m], at joint coordinates, by a model.

    Yields
    ------
    Verdict
        As they are found. However the iteration ends, all axes are stopped and switched off.
    """
    stop = False
    keeper = keeper or SettingsKeeper()
    keeper.open(drives)
    for verdict in _unpowered(UnpoweredDrives(bus, drives, pacing), drives, keeper):
        stop |= verdict.grade is Grade.REFUSED
        yield verdict
    if stop:
        yield Verdict(
            Grade.REFUSED,
            "all axes",
            "motion",
            "not tried, nothing was powered on",
            remedy="mend what is refused above, or check the other axes alone with --axis",
        )
        return
    require_consent(operator, _intent(drives, moves))
    yield from check_powered(bus, drives, moves, operator, pacing, keeper, gravity)
    yield from _brakes(UnpoweredDrives(bus, drives, pacing), drives.axes)


def _unpowered(
    unpowered: UnpoweredDrives, drives: DrivesFile, keeper: SettingsKeeper
) -> Iterator[Verdict]:
    pairs = list(zip(unpowered.servers, drives.axes, strict=True))
    strangers = cache(partial(_strangers, unpowered, drives))
    for server, axis in pairs:
        serves = True
        for verdict in _ask(unpowered.network, server, axis, strangers):
            if verdict.grade is Grade.REFUSED:
                serves = False
                another = mixed_up(server, axis, pairs) if verdict.check in _BY_NODE else None
                yield verdict if another is None else replace(verdict, remedy=another)
            else:
                yield verdict
        if serves:
            yield from _written(server, axis, drives, partial(keeper.found, server))
    yield _load(drives)


def _strangers(unpowered: UnpoweredDrives, drives: DrivesFile) -> list[RemoteDictionary]:
    """Return drives on the bus that the drives file does not name."""
    network, own = unpowered.network, {axis.node for axis in drives.axes}
    found = scan_bus(network.channel, only=tuple(node for node in NODES if node not in own)).nodes
    return [RemoteDictionary(network, node, "a drive") for node in found if found[node].dictionary]


def _misnumbered(strangers: Sequence[RemoteDictionary], axis: AxisDrive) -> str:
    """State which drive may be the one that does not answer, under another number."""
    nodes = " or ".join(str(server.node) for server in strangers if fits(server, axis))
    if not nodes:
        return ""
    return (
        f"a drive that is not in the drives file fits {axis.name} by identity and ratings: state "
        f"node: {nodes}, or give the drive the number {axis.node}"
    )


def _written(
    server: RemoteDictionary,
    axis: AxisDrive,
    drives: DrivesFile,
    find: Callable[[Entry], int | None],
) -> Iterator[Verdict]:
    """State what powering on will write to the drive, with the values there; write nothing."""
    try:
        changes = announce(server, axis, drives, drives.sync_period, find).changes
    except DriveError as error:
        yield refused(server.label, "configuration", error)
        return
    for change in changes:
        entry, present = change.entry, change.present
        bound = f"{entry.shown(change.value)} is written for the session"
        if present is not None:
            bound += f", then {entry.shown(present)} again"
        found = "write-only" if present is None else entry.shown(present)
        yield Verdict(Grade.OK, server.label, f"set: {entry}", found, bound)


def _ask(
    network: PumpedNetwork,
    server: RemoteDictionary,
    axis: AxisDrive,
    strangers: Callable[[], list[RemoteDictionary]],
) -> Iterator[Verdict]:
    """What can be asked without power; the first error ends it, for it would only repeat."""
    try:
        identity = check_identity(server, axis)
    except DriveRefused as error:
        found, _, remedy = str(error).removeprefix(f"{server.label}: ").rpartition("; ")
        yield Verdict(Grade.REFUSED, server.label, IDENTITY, found, remedy=remedy)
        return
    except NodeSilent as error:
        yield replace(
            refused(server.label, "answers", error), remedy=_misnumbered(strangers(), axis)
        )
        return
    try:
        yield Verdict(Grade.OK, server.label, IDENTITY, identity)
        yield check_state(server, Supervision([server]))
        yield from _offer(read_dictionary(network, axis.node, SDO_TIMEOUT), server.label, axis)
        yield from check_scaling(server, axis)
        yield from check_limits(server, axis)
        yield from check_reactions(server, axis)
    except DriveError as error:
        yield refused(server.label, "answers", error)


def _offer(dictionary: Dictionary, place: str, axis: AxisDrive) -> Iterator[Verdict]:
    """State what the dictionary lacks."""
    check = "objects that measuring needs"
    findings = review(dictionary, axis).findings
    for finding in findings:
        grade = Grade.REFUSED if finding.fatal else Grade.WARNING
        found = f"{finding.about} {finding.problem}"
        yield Verdict(grade, place, check, found, remedy=finding.consequence)
    if not findings:
        yield Verdict(Grade.OK, place, check, "all there")


def _brakes(unpowered: UnpoweredDrives, axes: Sequence[AxisDrive]) -> Iterator[Verdict]:
    try:
        before = [server.get(objects.POSITION) for server in unpowered.servers]
        unpowered.wait(REST_TIME)
        after = [server.get(objects.POSITION) for server in unpowered.servers]
    except DriveError as error:
        yield refused("all axes", "brakes", error)
        return
    for server, axis, *ends in zip(unpowered.servers, axes, before, after, strict=True):
        sagged = abs(ends[1] - ends[0]) * abs(AxisScale.of(axis).position)
        unit = axis.unit
        yield graded(
            sagged <= axis.position_window,
            Grade.REFUSED,
            server.label,
            "holding without power (brake)",
            f"moved {sagged:.2g} {unit} in {REST_TIME:g} s",
            f"at most {axis.position_window:g} {unit}",
            "the axis sinks when it is switched off: check the brake before anything else",
        )


def _load(drives: DrivesFile) -> Verdict:
    load = cycle_time(drives) / drives.sync_period
    return graded(
        load <= MAX_LOAD,
        Grade.REFUSED,
        "bus",
        "load",
        f"{load:.1%} at {1 / drives.sync_period:.4g} Hz and {drives.bitrate // 1000} kbit/s",
        f"at most {MAX_LOAD:.0%}",
        f"lengthen sync_period to {cycle_time(drives) / MAX_LOAD:.4g} s",
    )


def _intent(drives: DrivesFile, moves: SmallMoves) -> str:
    """What the operator is asked to agree to."""
    ways = ", ".join(f"{axis.name} {shown_way(axis, moves.of(axis)[0])}" for axis in drives.axes)
    return f"Power on, and move one after the other there and back: {ways}?"
