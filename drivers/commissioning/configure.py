"""Making sure that a drive is the right one and can serve, and configuring it.

Everything here happens by SDO while the drive is off and pre-operational, and everything that is
written is read back. A drive that lacks what safety or measurement need is refused with the reason;
what it can be used without is noted. `commission` is called for every drive before any is switched
on.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.pdo_mapping import current_entry
from drivers.canopen.sdo import Aborted
from drivers.cia402 import objects
from drivers.cia402.states import MODE_TIME, Mode
from drivers.commissioning.communication_set_up import set_up_communication
from drivers.commissioning.consistency import compare_statements
from drivers.commissioning.measures import Quantity, measures
from drivers.commissioning.readback import Readback
from drivers.commissioning.requirement import Lack
from drivers.commissioning.requirements import DRIVE_PROFILE, REQUIREMENTS, reaction_for
from drivers.commissioning.software_limits import write_range
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from drivers.canopen.communication import Communication
    from drivers.canopen.sdo import RemoteDictionary
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry

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


def commission(
    server: RemoteDictionary,
    axis: AxisDrive,
    drives: DrivesFile,
    period: float,
    wait: Callable[[Callable[[], bool], float], bool],
    limits: EffectiveLimits,
    communication: Communication,
) -> str:
    """Check and configure one drive that is off and pre-operational.

    Parameters
    ----------
    server : RemoteDictionary
        Its object dictionary.
    axis, drives : AxisDrive, DrivesFile
        What the drives file states.
    period : float
        Time between two SYNCs [s].
    wait : callable
        ``wait(condition, timeout)`` lets time pass; returns whether the condition came to hold.
    limits : EffectiveLimits
        Which hold on this axis.
    communication : Communication
        What the drive sends and listens to; what is found is put in.

    Returns
    -------
    str
        The drive's identity.

    Raises
    ------
    DriveRefused, NodeSilent
        Why the drive cannot serve.
    """
    server.judge = Readback(axis, drives)
    identity = check_identity(server, axis)
    _take_profile_position(server, wait)
    compare_statements(server, axis)
    _require_current(server, axis)
    for note in limits.notes:
        server.note(note)
    values = _values(axis, drives, limits)
    _lower_profile(server, values)
    _write_limits(server, axis, values)
    _write_reactions(server, values)
    set_up_communication(server, axis, drives, period, communication)
    return identity


def check_identity(server: RemoteDictionary, axis: AxisDrive) -> str:
    """Return the drive's identity (1018); refuse a drive that is another than the file states."""
    profile = server.get(cia301.DEVICE_TYPE) & 0xFFFF
    if profile != DRIVE_PROFILE:
        raise DriveRefused(
            f"{server.label}: device profile {profile} is no CiA 402 drive; check the node number"
        )
    expected = axis.identity
    wanted = (expected.vendor, expected.product, expected.revision, expected.serial)
    found = [server.find(entry) for entry in cia301.IDENTITY]
    for entry, present, value in zip(cia301.IDENTITY, found, wanted, strict=True):
        if value is not None and present != value:
            shown = "missing" if present is None else f"{present:08X}h"
            raise DriveRefused(
                f"{server.label}: {entry.name} {shown}, the drives file expects {value:08X}h; "
                "check node numbers and wiring, or correct identity in the drives file"
            )
    return " ".join(
        f"{entry.name} {value:08X}h"
        for entry, value in zip(cia301.IDENTITY, found, strict=True)
        if value is not None
    )


def _take_profile_position(
    server: RemoteDictionary, wait: Callable[[Callable[[], bool], float], bool]
) -> None:
    supported = server.find(objects.SUPPORTED_MODES)
    if supported is not None and not supported & Mode.PROFILE_POSITION.supported_bit:
        raise DriveRefused(
            f"{server.label}: no profile position mode (6502 = {supported:08X}h, bit 0 is clear); "
            "use a drive or firmware that has it"
        )
    server.put(objects.MODE, Mode.PROFILE_POSITION)
    if not wait(lambda: server.get(objects.MODE_DISPLAY) == Mode.PROFILE_POSITION, MODE_TIME):
        raise DriveRefused(
            f"{server.label}: does not take profile position mode: 6061 shows "
            f"{server.get(objects.MODE_DISPLAY)} {MODE_TIME:g} s after 1 was written to 6060; "
            "release it from the maker's tool or from another master"
        )


def _require_current(server: RemoteDictionary, axis: AxisDrive) -> None:
    try:
        server.get(current_entry(axis))
    except Aborted as error:
        raise DriveRefused(
            f"{error}; torques cannot be measured without it: name the object that shows the "
            "drive's current or torque as current in the drives file"
        ) from error


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


def _write_limits(server: RemoteDictionary, axis: AxisDrive, values: Mapping[Entry, int]) -> None:
    write_range(server, axis, values)
    for entries in _LIMITS:
        if not _write_limit(server, entries, values):
            server.do_without(entries, REQUIREMENTS[entries[0]].without)
    torque, current = objects.MAX_TORQUE, objects.MAX_CURRENT
    limited = _write_limit(server, (torque,), values)
    _refuse_zeros(server, axis, values)
    for entry in _KEPT_WHERE_PRESENT:
        _write(server, entry, values[entry])
    if not limited and server.find(current) is not None:
        _write_limit(server, (current,), values)
    elif not limited:
        server.do_without((torque, current), REQUIREMENTS[torque].without)
    for entry in _MOTION:
        _write(server, entry, values[entry])


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
