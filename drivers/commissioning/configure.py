"""Making sure that a drive is the right one and can serve, and configuring it.

Everything here happens by SDO while the drive is off and pre-operational, and everything that is
written is read back. A drive that lacks what safety or measurement need is refused with the reason;
what it can be used without is noted. `commission` is called for every drive before any is switched
on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.states import MODE_TIME, Mode
from drivers.commissioning.consistency import compare_statements
from drivers.commissioning.readback import readback
from drivers.commissioning.requirements import DRIVE_PROFILE, OF_PROFILES
from drivers.commissioning.values_set_up import write_values
from drivers.drive_bus import DriveRefused
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.commissioning.communication import Communication
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.remote_dictionary import RemoteDictionary


def commission(
    server: RemoteDictionary,
    axis: AxisDrive,
    drives: DrivesFile,
    period: float,
    wait: Callable[[Callable[[], bool], float], bool],
    limits: EffectiveLimits,
    communication: Communication,
) -> tuple[str, Mode]:
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
        How it communicates; what is found is put in.

    Returns
    -------
    str, Mode
        The drive's identity, and in which mode it moves: profile position, or cyclic position, in
        which the driver plans.

    Raises
    ------
    DriveRefused, NodeSilent
        Why the drive cannot serve.
    """
    server.judge = readback(axis, drives, communication.requirements)
    identity = check_identity(server, axis)
    mode = _take_mode(server, wait, wraps=limits.wrap is not None)
    compare_statements(server, axis)
    _require_current(server, axis)
    planned = mode is Mode.CYCLIC_POSITION
    write_values(server, axis, drives, limits, without=OF_PROFILES if planned else frozenset())
    communication.set_up(server, axis, drives, period)
    return identity, mode


def check_identity(server: RemoteDictionary, axis: AxisDrive) -> str:
    """Return the drive's identity (1018); refuse a drive that is another than the file states."""
    profile = server.get(objects.DEVICE_TYPE) & 0xFFFF
    if profile != DRIVE_PROFILE:
        raise DriveRefused(
            f"{server.label}: device profile {profile} is no CiA 402 drive; check the node number"
        )
    expected = axis.identity
    wanted = (expected.vendor, expected.product, expected.revision, expected.serial)
    found = [server.find(entry) for entry in objects.IDENTITY]
    for entry, present, value in zip(objects.IDENTITY, found, wanted, strict=True):
        if value is not None and present != value:
            shown = "missing" if present is None else f"{present:08X}h"
            raise DriveRefused(
                f"{server.label}: {entry.name} {shown}, the drives file expects {value:08X}h; "
                "check node numbers and wiring, or correct identity in the drives file"
            )
    return " ".join(
        f"{entry.name} {value:08X}h"
        for entry, value in zip(objects.IDENTITY, found, strict=True)
        if value is not None
    )


def _take_mode(
    server: RemoteDictionary, wait: Callable[[Callable[[], bool], float], bool], *, wraps: bool
) -> Mode:
    """Choose profile position, or cyclic position, in which the driver plans the ways."""
    supported = server.find(objects.SUPPORTED_MODES)
    modes = [
        (Mode.PROFILE_POSITION, "profile position mode"),
        (Mode.CYCLIC_POSITION, "cyclic synchronous position mode"),
    ]
    has = [each for each in modes if supported is None or supported & each[0].supported_bit]
    if wraps:  # a target of profile position may be reached by either way round
        has = [each for each in has if each[0] is Mode.CYCLIC_POSITION]
        if not has:
            raise DriveRefused(
                f"{server.label}: positions wrap around (607B) within the limits of the drives file"
                f" and there is no cyclic synchronous position mode (6502 = {supported:08X}h, bit 7"
                " is clear), in which the driver would lead the axis; have the drive count from"
                " another zero, or switch 607B off with the maker's commissioning tool"
            )
    if not has:
        raise DriveRefused(
            f"{server.label}: neither profile position nor cyclic synchronous position mode (6502 ="
            f" {supported:08X}h, bits 0 and 7 are clear); velocity and torque modes keep no"
            " position, so nothing would hold the axis where the plan has checked it: use a drive"
            " or firmware that has one of them"
        )
    mode, name = has[0]
    server.put(objects.MODE, mode)
    if not wait(lambda: server.get(objects.MODE_DISPLAY) == mode, MODE_TIME):
        raise DriveRefused(
            f"{server.label}: does not take {name}: 6061 shows"
            f" {server.get(objects.MODE_DISPLAY)} {MODE_TIME:g} s after {mode.value} was written to"
            " 6060; release it from the maker's tool or from another master"
        )
    return mode


def _require_current(server: RemoteDictionary, axis: AxisDrive) -> None:
    try:
        server.measure(axis.current.entry)
    except Aborted as error:
        raise DriveRefused(
            f"{error}; torques cannot be measured without it: name the object that shows the "
            "drive's current or torque as current in the drives file"
        ) from error
