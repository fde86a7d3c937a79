"""`hil drives check`: comparison of the drives file with the drives on the bus.

The steps become gradually less harmless. First the drives are read by SDO, unpowered, without
writing; the check ends here after a refusal. Then, with the operator's consent, the drives are
configured and powered as for a run and hold their position; then each axis in turn moves a few
degrees and back, slowly and supervised (`check_powered`). At the end the drives are switched off
and must not move, held by their brakes. Verdicts are yielded as they are found.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.cia402.supervision import Supervision
from drivers.commissioning.announcement import announce
from drivers.commissioning.configure import check_identity, find_swap, fits
from drivers.commissioning.consistency import GEAR, POSITION
from drivers.commissioning.effective_limits import range_of, wrap_of
from drivers.commissioning.ratings import CURRENT, TORQUE
from drivers.commissioning.verdict import Grade, Verdict, grade_check, refused
from drivers.dictionary.live import read_dictionary
from drivers.dictionary.review import review
from drivers.drive_bus import DriveError, DriveRefused, NodeSilent
from drivers.found_settings.keeping import SettingsKeeper
from drivers.operator_tools.check_objects import check_limits, check_reactions, check_scaling
from drivers.operator_tools.check_powered import REST_TIME, check_powered
from drivers.operator_tools.operator import require_consent
from drivers.operator_tools.reset_faults import check_state
from drivers.operator_tools.small_move import format_coordinate
from drivers.session.connection import Place

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence

    from drivers.commissioning.communication import Communication
    from drivers.commissioning.verdict import Check
    from drivers.dictionary.review import BusRules
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.operator_tools.check_motion import Gravity
    from drivers.operator_tools.check_powered import SmallMoves
    from drivers.operator_tools.operator import Operator
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Fieldbus, UnpoweredDrives

IDENTITY = "identity (1018)"
CHECKS: tuple[Check, ...] = (check_scaling, check_limits, check_reactions)
"""Checks of a suitable drive, in order."""
_BY_NODE = frozenset({IDENTITY, CURRENT, TORQUE, POSITION, GEAR})
"""Checks that also fail with swapped node numbers."""


def check(
    bus: Fieldbus,
    drives: DrivesFile,
    moves: SmallMoves,
    operator: Operator,
    keeper: SettingsKeeper | None = None,
    gravity: Gravity | None = None,
    late: float = 0.0,
) -> Generator[Verdict, None, None]:
    """Check every axis of a drives file on a live bus.

    Parameters
    ----------
    bus : Fieldbus
        An open bus.
    drives : DrivesFile
        The axes to check, in joint order.
    moves : SmallMoves
        Distance and speed of the small moves.
    operator : Operator
        Consents to motion, can stop it, and is asked for its direction.
    keeper : SettingsKeeper, optional
        See `drivers.session.servo_axes.ServoAxes`.
    gravity : callable, optional
        Holding torques of the axes of `drives` [N m] at joint coordinates, by a model.
    late : float
        Wake-up delay of this process (see `drivers.operator_tools.sync_period.judge_period`).

    Yields
    ------
    Verdict
        Verdicts as they are found. Whenever the iteration ends, all axes are stopped and off.
    """
    stop = False
    keeper = keeper or SettingsKeeper()
    keeper.open(drives)
    for verdict in _unpowered(bus, drives, keeper):
        stop |= verdict.grade is Grade.REFUSED
        yield verdict
    if stop:
        yield Verdict(
            Grade.REFUSED,
            "all axes",
            "motion",
            "not tried, nothing was powered on",
            remedy="correct the refused items above, or check the other axes alone with --axis",
        )
        return
    distances = (f"{a.name} {format_coordinate(a, moves.find(a)[0], '+.3g')}" for a in drives.axes)
    intent = f"Power on, and move one after the other there and back: {', '.join(distances)}?"
    require_consent(operator, intent)
    yield from check_powered(bus, drives, moves, operator, keeper, gravity, late)
    yield from _brakes(bus.unpowered(drives), drives.axes)


def _unpowered(bus: Fieldbus, drives: DrivesFile, keeper: SettingsKeeper) -> Iterator[Verdict]:
    unpowered = bus.unpowered(drives)
    pairs = list(zip(unpowered.servers, drives.axes, strict=True))
    strangers = cache(partial(_find_strangers, bus, drives))
    for (server, axis), communication in zip(pairs, unpowered.communications, strict=True):
        serves = True
        for verdict in _ask(bus.rules, server, axis, strangers):
            if verdict.grade is Grade.REFUSED:
                serves = False
                another = find_swap(server, axis, pairs) if verdict.check in _BY_NODE else None
                yield verdict if another is None else replace(verdict, remedy=another)
            else:
                yield verdict
        if serves:
            held = partial(keeper.found, server)
            yield from _list_changes(server, axis, drives, communication, held)
    cycle, most = bus.load(drives)
    load = cycle / drives.sync_period
    yield grade_check(
        load <= most,
        Grade.REFUSED,
        "bus",
        "load",
        f"{load:.1%} at {1 / drives.sync_period:.4g} Hz and {drives.bitrate // 1000} kbit/s",
        f"at most {most:.0%}",
        f"lengthen sync_period to {cycle / most:.4g} s",
    )


def _find_strangers(bus: Fieldbus, drives: DrivesFile) -> Sequence[RemoteDictionary]:
    """Return drives on the bus that are not in the drives file."""
    own = {axis.node for axis in drives.axes}
    found = bus.scan(besides=own).nodes
    places = [Place(node, "a drive") for node in found if found[node].dictionary]
    return bus.servers(places, drives.sdo_timeout)


def _list_changes(
    server: RemoteDictionary,
    axis: AxisDrive,
    drives: DrivesFile,
    communication: Communication,
    find: Callable[[Entry], int | None],
) -> Iterator[Verdict]:
    """Yield the values that power-on will write, and the present ones; nothing is written."""
    try:
        changes = announce(server, axis, drives, drives.sync_period, communication, find).changes
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
    rules: BusRules,
    server: RemoteDictionary,
    axis: AxisDrive,
    strangers: Callable[[], Sequence[RemoteDictionary]],
) -> Iterator[Verdict]:
    """Yield checks of an unpowered drive until an error, which later checks would only repeat."""
    try:
        identity = check_identity(server, axis)
    except DriveRefused as error:
        found, _, remedy = str(error).removeprefix(f"{server.label}: ").rpartition("; ")
        yield Verdict(Grade.REFUSED, server.label, IDENTITY, found, remedy=remedy)
        return
    except NodeSilent as error:
        # the drive may be on the bus with another number
        nodes = " or ".join(str(other.node) for other in strangers() if fits(other, axis))
        remedy = (
            f"a drive that is not in the drives file fits {axis.name} by identity and ratings: "
            f"state node: {nodes}, or give the drive the number {axis.node}"
        )
        yield replace(refused(server.label, "answers", error), remedy=remedy if nodes else "")
        return
    try:
        yield Verdict(Grade.OK, server.label, IDENTITY, identity)
        yield check_state(server, Supervision([server]))
        dictionary = read_dictionary(server.access, axis.node, rules)
        findings, what = review(dictionary, rules, axis).findings, "objects needed for measuring"
        for finding in findings:
            grade = Grade.REFUSED if finding.fatal else Grade.WARNING
            found = f"{finding.about} {finding.problem}"
            yield Verdict(grade, server.label, what, found, remedy=finding.consequence)
        if not findings:
            yield Verdict(Grade.OK, server.label, what, "all present")
        for each in CHECKS:
            yield from each(server, axis)
    except DriveError as error:
        yield refused(server.label, "answers", error)


def _brakes(unpowered: UnpoweredDrives, axes: Sequence[AxisDrive]) -> Iterator[Verdict]:
    try:
        before = [server.get(objects.POSITION) for server in unpowered.servers]
        unpowered.wait(REST_TIME)
        after = [server.get(objects.POSITION) for server in unpowered.servers]
    except DriveError as error:
        yield refused("all axes", "brakes", error)
        return
    for server, axis, *ends in zip(unpowered.servers, axes, before, after, strict=True):
        wrap = wrap_of(range_of(server.find), axis, server.label)
        places = [wrap.unwrap(end) if wrap else end for end in ends]
        sagged = abs(places[1] - places[0]) * abs(AxisScale.derive(axis).position)
        unit = axis.unit
        yield grade_check(
            sagged <= axis.position_window,
            Grade.REFUSED,
            server.label,
            "holding without power (brake)",
            f"moved {sagged:.2g} {unit} in {REST_TIME:g} s",
            f"at most {axis.position_window:g} {unit}",
            "the axis sinks when switched off: check the brake first",
        )
