"""Writing of limits, profile, windows and reactions to a drive, by the table of requirements.

The order suits drives that check values against each other: the profile is lowered before the
limits are written, and set afterwards. A limit already in the drive is left alone, and a limit with
several possible objects is missing only if all of them are.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.commissioning.measures import Quantity, measures
from drivers.commissioning.requirements import REQUIREMENTS, Lack, reaction_for
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
    for entry in (objects.MAX_PROFILE_VELOCITY, objects.MAX_ACCELERATION, objects.MAX_DECELERATION)
)
"""Limits with several possible objects; the torque limit is written to only one of its objects."""
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
    """Write the values of drives file and limits in force, and note the consequences.

    Objects in `without` are not written.

    Raises
    ------
    DriveRefused, NodeSilent
        The drive lacks a required object, or keeps an unacceptable value.
    """
    for note in holding.notes:
        server.note(note)
    values = _values(axis, drives, holding)
    # some drives refuse a limit below their profile, so the profile is lowered first
    for entry in (*_MOTION, objects.PROFILE_DECELERATION):
        present = server.find(entry)
        if present is not None and present > values[entry]:
            with suppress(Aborted):  # the kept value is judged after the limits
                server.put(entry, values[entry])
    _write_limits(server, axis, values, without)
    for entry in (objects.QUICK_STOP_OPTION, objects.HALT_OPTION):
        _write(server, entry, values[entry])
    quick_stop = server.kept.get(objects.QUICK_STOP_OPTION, 0)
    _write(server, objects.ABORT_CONNECTION_OPTION, reaction_for(quick_stop))


def _values(axis: AxisDrive, drives: DrivesFile, holding: EffectiveLimits) -> dict[Entry, int]:
    """Return the values for the drive, by object [drive's unit]."""
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
    """Write software limits; accept and note fixed ones, unless they are off.

    Fixed limits inside those of the file are kept. Fixed limits outside are harmless, but only the
    driver keeps the range. Limits that are off protect nothing, as in a drive without the objects.
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
    found = []
    if kept[0] < ends[0] - 1 or kept[1] > ends[1] + 1:
        found.append("only the driver enforces the axis's range")
    if kept[0] > ends[0] or kept[1] < ends[1]:
        found.append("the drive refuses targets beyond its limits")
    consequence = " and ".join(found) or "they agree to an increment"
    server.note(
        f"software limits (607D) are fixed at {own}, those of the drives file are "
        f"{ours}: {consequence}"
    )


def _write(server: RemoteDictionary, entry: Entry, value: int) -> None:
    """Write an object as required by the table; report drives without the object."""
    row = REQUIREMENTS[entry]
    if row.lack is Lack.REFUSED:
        server.set(entry, value)
    else:
        server.set_if_present(entry, value, row.without, row.serves)


def _refuse_zeros(server: RemoteDictionary, axis: AxisDrive, values: Mapping[Entry, int]) -> None:
    """Refuse a limit below one count of an object, since 0 means no limit in many drives."""
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
    """Write a limit to the objects for it, except those with that limit already.

    Returns
    -------
    bool
        True if the drive has any of the objects.
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
