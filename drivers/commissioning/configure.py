"""Making sure that a drive is the right one and can serve, and configuring it.

Everything here happens by SDO while the drive is off and pre-operational, and everything that is
written is read back. A drive that lacks what safety or measurement need is refused with the reason;
what it can be used without is noted. `commission` is called for every drive before any is switched
on.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.canopen import objects as cia301
from drivers.canopen.communication_set_up import set_up_communication
from drivers.canopen.pdo_mapping import current_entry
from drivers.canopen.readback import Readback
from drivers.canopen.sdo import Aborted
from drivers.cia402 import objects
from drivers.cia402.states import Mode
from drivers.commissioning.consistency import compare_statements
from drivers.commissioning.software_limits import write_range
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from drivers.canopen.communication import Communication
    from drivers.canopen.sdo import RemoteDictionary
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drives_file import AxisDrive, AxisLimits, DrivesFile
    from drivers.fieldbus import Entry

DRIVE_PROFILE = 402
SLOW_DOWN_RAMP = 1
QUICK_STOP_REACTION, FAULT_REACTION = 3, 1
STAYS_ENERGISED = 5
"""Quick stop options from here on end in QUICK STOP ACTIVE."""
STOPPING_OPTIONS = (1, 2, 3, 5, 6, 7)
"""Quick stop options that slow down, instead of letting the axis coast (0)."""
MODE_TIME = 3.0
"""A mode display may lag by seconds [s]."""


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
    _lower_profile(server, axis, limits.limits)
    _write_limits(server, axis, limits)
    _write_reactions(server, drives)
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
    entries = (cia301.VENDOR, cia301.PRODUCT, cia301.REVISION, cia301.SERIAL)
    found = [server.find(entry) for entry in entries]
    for entry, present, value in zip(entries, found, wanted, strict=True):
        if value is not None and present != value:
            shown = "missing" if present is None else f"{present:08X}h"
            raise DriveRefused(
                f"{server.label}: {entry.name} {shown}, the drives file expects {value:08X}h; "
                "check node numbers and wiring, or correct identity in the drives file"
            )
    return " ".join(
        f"{entry.name} {value:08X}h"
        for entry, value in zip(entries, found, strict=True)
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


def _lower_profile(server: RemoteDictionary, axis: AxisDrive, limits: AxisLimits) -> None:
    """Lower what is above our limits first: some drives refuse a limit below their profile."""
    scale = AxisScale.of(axis)
    acceleration = scale.acceleration_to_counts(limits.acceleration)
    for entry, value in (
        (objects.PROFILE_VELOCITY, scale.velocity_to_counts(limits.velocity)),
        (objects.PROFILE_ACCELERATION, acceleration),
        (objects.PROFILE_DECELERATION, acceleration),
    ):
        present = server.find(entry)
        if present is not None and present > value:
            with suppress(Aborted):  # what it keeps is judged where the limits are written
                server.put(entry, value)


def _write_limits(server: RemoteDictionary, axis: AxisDrive, holding: EffectiveLimits) -> None:
    scale, limits, values = AxisScale.of(axis), holding.limits, holding.values
    server.notes += holding.notes
    write_range(server, axis, values)
    for either in (
        (objects.MAX_PROFILE_VELOCITY, objects.MAX_MOTOR_SPEED),
        (objects.MAX_ACCELERATION,),
        (objects.MAX_DECELERATION,),
        (objects.MAX_TORQUE,),
    ):
        _write_limit(server, {entry: values[entry] for entry in either})
    acceleration = scale.acceleration_to_counts(limits.acceleration)
    velocity = scale.velocity_to_counts(limits.velocity)
    window = round(axis.following_error_window / abs(scale.position))
    quick_stop = objects.QUICK_STOP_DECELERATION
    for entry, value, key in (
        (objects.PROFILE_VELOCITY, velocity, f"limits.velocity {limits.velocity:g}"),
        (
            objects.PROFILE_ACCELERATION,
            acceleration,
            f"limits.acceleration {limits.acceleration:g}",
        ),
        (
            objects.FOLLOWING_ERROR_WINDOW,
            window,
            f"following_error_window {axis.following_error_window:g}",
        ),
    ):
        _refuse_zero(server, entry, value, key)
    for entry, value, consequence in (
        (objects.PROFILE_DECELERATION, acceleration, "6083 must hold for decelerating too"),
        (quick_stop, values[quick_stop], "the drive's own quick stop ramp is used"),
        (objects.FOLLOWING_ERROR_WINDOW, window, _UNWATCHED),
        (objects.PROFILE_TYPE, 0, "trapezoidal profiles are taken on trust"),
    ):
        server.set_if_present(entry, value, consequence)
    for entry, value, consequence in (
        (objects.FOLLOWING_ERROR_TIME, round(1000 * axis.following_error_time), _UNWATCHED),
        (objects.POSITION_WINDOW, round(axis.position_window / abs(scale.position)), _OWN_WINDOW),
        (objects.POSITION_WINDOW_TIME, round(1000 * axis.position_window_time), _OWN_WINDOW),
    ):
        server.set_if_present(entry, value, consequence, also=_ANY)
    if objects.MAX_TORQUE in server.missing and server.find(objects.MAX_CURRENT) is not None:
        _write_limit(server, {objects.MAX_CURRENT: values[objects.MAX_CURRENT]})
    server.set(objects.PROFILE_VELOCITY, velocity)
    server.set(objects.PROFILE_ACCELERATION, acceleration)


def _refuse_zero(server: RemoteDictionary, entry: Entry, value: int, key: str) -> None:
    """Refuse a limit below one count of an object: to many drives 0 means that there is none."""
    if not value and server.find(entry) is not None:
        raise DriveRefused(
            f"{server.label}: {key} of the drives file is less than one count of object {entry},"
            " and 0 may mean no limit; raise it, or set a finer unit in the drive"
        )


def _write_limit(server: RemoteDictionary, values: Mapping[Entry, int]) -> None:
    """Write a limit that one or several objects keep; leave alone what is there already."""
    present = {entry: server.find(entry) for entry in values}
    if not any(present[entry] == value for entry, value in values.items()):
        server.set_any(values, "this limit is kept by the driver alone")
        return
    server.missing.update(entry for entry, value in present.items() if value is None)
    for entry, value in values.items():
        if present[entry] == value:
            server.kept[entry] = value
        elif present[entry] is not None:
            server.set(entry, value)


_UNWATCHED = "the drive's own following error supervision is used"
_OWN_WINDOW = "the drive's own window decides on target reached"
_ANY = range(1 << 32)


def _write_reactions(server: RemoteDictionary, drives: DrivesFile) -> None:
    option, reaction = objects.QUICK_STOP_OPTION, objects.ABORT_CONNECTION_OPTION
    own = "the drive's own quick stop is used"
    server.set_if_present(option, drives.quick_stop_option, own, STOPPING_OPTIONS)
    server.set_if_present(
        objects.HALT_OPTION, SLOW_DOWN_RAMP, "the drive's own halt is used", (2, 3, 4)
    )
    unknown = "its reaction to the loss of our heartbeat is the maker's: look it up"
    if server.kept.get(option, 0) < STAYS_ENERGISED:
        server.set_if_present(reaction, QUICK_STOP_REACTION, unknown, (1, 2))
    else:  # a quick stop alone would leave the axis powered when this process dies
        server.set_if_present(reaction, FAULT_REACTION, unknown, (2, 3))
