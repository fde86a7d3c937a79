"""Writing limits, profile, windows and reactions to a drive, each as its row of the table has it.

The order is that of drives that check one value against another: the profile comes down before the
limits are written, and is set when they are. A limit that the drive holds already is left alone,
and one that any of several objects keeps is missing only where all of them are.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.commissioning.measures import Quantity, measures
from drivers.commissioning.requirement import Lack
from drivers.commissioning.requirements import REQUIREMENTS, reaction_for
from drivers.drive_bus import DriveRefused
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary

_LIMITS = tuple(
    (entry, *REQUIREMENTS[entry].instead)
    for entry in (
        objects.MAX_PROFILE_VELOCITY,
        objects.MAX_ACCELERATION,
        objects.MAX_DECELERATION,
    )
)
"""Limits of which any of several objects serves; that of torque is written to one alone."""
_KEPT_WHERE_PRESENT = (
    objects.PROFILE_DECELERATION,
    objects.QUICK_STOP_DECELERATION,
    objects.FOLLOWING_ERROR_WINDOW,
    objects.PROFILE_TYPE,
    objects.FOLLOWING_ERROR_TIME,
    objects.POSITION_WINDOW,
    objects.POSITION_WINDOW_TIME,
)
_MOTION = (objects.PROFILE_VELOCITY, objects.PROFILE_ACCELERATION)


def write_values(
    server: RemoteDictionary,
    axis: AxisDrive,
    drives: DrivesFile,
    holding: EffectiveLimits,
    without: frozenset[Entry] = frozenset(),
) -> None:
    """Write what the drives file and the limits that hold lead to, and note what follows.

    Objects `without` use are left as they are.

    Raises
    ------
    DriveRefused, NodeSilent
        The drive lacks an object that it is refused for, or keeps a value that does not serve.
    """
    for note in holding.notes:
        server.note(note)
    values = _values(axis, drives, holding)
    _lower_profile(server, values)
    _write_limits(server, axis, values, without)
    _write_reactions(server, values)


def _values(axis: AxisDrive, drives: DrivesFile, holding: EffectiveLimits) -> dict[Entry, int]:
    """Return what is to stand in the drive, by object [the drive's unit]."""
    counted, limits = measures(axis), holding.limits
    velocity = counted[Quantity.SPEED].counts(limits.velocity)
    acceleration = counted[Quantity.ACCELERATION].counts(limits.acceleration)
    distance = counted[Quantity.DISTANCE].counts
    constant = {row.entry: row.value for row in REQUIREMENTS.values() if row.value is not None}
    return {
        **constant,
        **holding.values,
        objects.PROFILE_VELOCITY: velocity,
        objects.PROFILE_ACCELERATION: acceleration,
        objects.PROFILE_DECELERATION: acceleration,
        objects.FOLLOWING_ERROR_WINDOW: distance(axis.following_error_window),
        objects.FOLLOWING_ERROR_TIME: round(1000 * axis.following_error_time),
        objects.POSITION_WINDOW: distance(axis.position_window),
        objects.POSITION_WINDOW_TIME: round(1000 * axis.position_window_time),
        objects.QUICK_STOP_OPTION: drives.quick_stop_option,
    }


def _lower_profile(server: RemoteDictionary, values: Mapping[Entry, int]) -> None:
    """Lower what is above our limits first: some drives refuse a limit below their profile."""
    for entry in (*_MOTION, objects.PROFILE_DECELERATION):
        present = server.find(entry)
        if present is not None and present > values[entry]:
            with suppress(Aborted):  # what it keeps is judged where the limits are written
                server.put(entry, values[entry])


def _write_limits(
    server: RemoteDictionary,
    axis: AxisDrive,
    values: Mapping[Entry, int],
    without: frozenset[Entry],
) -> None:
    _write_range(server, axis, values)
    for entries in _LIMITS:
        if not _write_limit(server, entries, values):
            server.do_without(entries, REQUIREMENTS[entries[0]].without)
    torque, current = objects.MAX_TORQUE, objects.MAX_CURRENT
    limited = _write_limit(server, (torque,), values)
    _refuse_zeros(server, axis, values)
    for entry in _KEPT_WHERE_PRESENT:
        if entry not in without:
            _write(server, entry, values[entry])
    if not limited and server.find(current) is not None:
        _write_limit(server, (current,), values)
    elif not limited:
        server.do_without((torque, current), REQUIREMENTS[torque].without)
    for entry in _MOTION:
        if entry not in without:
            _write(server, entry, values[entry])


def _write_range(server: RemoteDictionary, axis: AxisDrive, values: Mapping[Entry, int]) -> None:
    """Write software limits; where they are fixed, take and note them, unless they are off.

    Fixed ones that lie inside ours stay. Those that lie outside do not hinder, but then it is the
    driver alone that keeps the range. Off, they keep the axis from nothing, as in a drive without.
    """
    scale, limits = AxisScale.derive(axis), axis.limits
    entries = (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)
    ends = [values[entry] for entry in entries]
    if [server.find(entry) for entry in entries] == ends:
        return
    taken = [server.set_unless_fixed(entry, end) for entry, end in zip(entries, ends, strict=True)]
    kept = [server.kept[entry] for entry in entries]
    if all(taken) or kept == ends:
        return
    unit = axis.unit
    low, high = sorted(scale.position_from_counts(float(end)) for end in kept)
    own, ours = f"[{low:.5g}, {high:.5g}] {unit}", f"[{limits.q_min:g}, {limits.q_max:g}] {unit}"
    if kept[0] >= kept[1]:
        raise DriveRefused(
            f"{server.label}: software limits (607D) are fixed at {kept[0]} and {kept[1]}, which "
            "switches them off: the drive itself would take any target; set them with the maker's "
            "commissioning tool"
        )
    server.note(
        f"software limits (607D) are fixed at {own}, those of the drives file are "
        f"{ours}: {_consequence(kept, ends)}"
    )


def _consequence(kept: Sequence[int], ends: Sequence[int]) -> str:
    found = []
    if kept[0] < ends[0] - 1 or kept[1] > ends[1] + 1:
        found.append("the driver alone keeps the axis's range")
    if kept[0] > ends[0] or kept[1] < ends[1]:
        found.append("it takes no target beyond its own")
    return " and ".join(found) or "they agree to an increment"


def _write(server: RemoteDictionary, entry: Entry, value: int) -> None:
    """Write an object as its row has it: refuse a drive without it, or note what follows."""
    row = REQUIREMENTS[entry]
    if row.lack is Lack.REFUSED:
        server.set(entry, value)
    else:
        server.set_if_present(entry, value, row.without, row.serves)


def _refuse_zeros(server: RemoteDictionary, axis: AxisDrive, values: Mapping[Entry, int]) -> None:
    """Refuse a limit below one count of an object: to many drives 0 means that there is none."""
    limits = axis.limits
    for entry, key, stated in (
        (objects.PROFILE_VELOCITY, "limits.velocity", limits.velocity),
        (objects.PROFILE_ACCELERATION, "limits.acceleration", limits.acceleration),
        (objects.FOLLOWING_ERROR_WINDOW, "following_error_window", axis.following_error_window),
    ):
        if not values[entry] and server.find(entry) is not None:
            raise DriveRefused(
                f"{server.label}: {key} {stated:g} of the drives file is less than one count of"
                f" object {entry}, and 0 may mean no limit; raise it, or set a finer unit in the"
                " drive"
            )


def _write_limit(
    server: RemoteDictionary, entries: Sequence[Entry], values: Mapping[Entry, int]
) -> bool:
    """Write a limit that one or several objects keep, but leave alone what is there already.

    Returns
    -------
    bool
        The drive has any of them.
    """
    present = {entry: server.find(entry) for entry in entries}
    if not any(present[entry] == values[entry] for entry in entries):
        return server.set_any({entry: values[entry] for entry in entries})
    server.missing.update(entry for entry, value in present.items() if value is None)
    for entry in entries:
        if present[entry] == values[entry]:
            server.kept[entry] = values[entry]
        elif present[entry] is not None:
            server.set(entry, values[entry])
    return True


def _write_reactions(server: RemoteDictionary, values: Mapping[Entry, int]) -> None:
    for entry in (objects.QUICK_STOP_OPTION, objects.HALT_OPTION):
        _write(server, entry, values[entry])
    quick_stop = server.kept.get(objects.QUICK_STOP_OPTION, 0)
    _write(server, objects.ABORT_CONNECTION_OPTION, reaction_for(quick_stop))
