"""Check and configuration of a drive before power-on.

Access is by SDO while the drive is off and pre-operational, and every written value is read back. A
drive without an object needed for safety or measurement is refused with the reason; other
deficiencies are noted. `commission` is called for every drive before any is switched on.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.states import MODE_TIME, Mode
from drivers.commissioning.consistency import compare_statements, comparisons
from drivers.commissioning.measures import measures
from drivers.commissioning.requirements import DRIVE_PROFILE, OF_PROFILES
from drivers.commissioning.values_set_up import write_values
from drivers.commissioning.verdict import Grade
from drivers.drive_bus import DriveError, DriveRefused
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from drivers.commissioning.communication import Communication
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.commissioning.requirements import Requirement
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import Judge, RemoteDictionary


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
    server, axis, drives, period
        See `drivers.commissioning.announcement.announce`.
    wait : callable
        ``wait(condition, timeout)`` lets time pass; returns True once the condition holds.
    limits : EffectiveLimits
        Limits in force.
    communication : Communication
        Communication of the drive; completed.

    Returns
    -------
    str, Mode
        Identity of the drive, and its mode: profile position, or cyclic position with motions
        planned by the driver.

    Raises
    ------
    DriveRefused, NodeSilent
        The drive is unsuitable.
    """
    server.judge = make_judge(axis, drives, communication.requirements)
    identity = check_identity(server, axis)
    mode = _take_mode(server, wait, wraps=limits.wrap is not None)
    compare_statements(server, axis)
    try:
        server.measure(axis.current.entry)
    except Aborted as error:
        raise DriveRefused(
            f"{error}; torques cannot be measured without it: state the object of the "
            "drive's current or torque under the key current in the drives file"
        ) from error
    planned = mode is Mode.CYCLIC_POSITION
    write_values(server, axis, drives, limits, without=OF_PROFILES if planned else frozenset())
    communication.set_up(server, axis, drives, period)
    return identity, mode


def check_identity(server: RemoteDictionary, axis: AxisDrive) -> str:
    """Return the identity of a drive (1018); refuse a drive other than stated in the file."""
    profile = server.get(objects.DEVICE_TYPE) & 0xFFFF
    if profile != DRIVE_PROFILE:
        raise DriveRefused(
            f"{server.label}: device profile {profile} is not a CiA 402 drive; check the node "
            "number"
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
    """Select profile position, or cyclic position with motions planned by the driver."""
    supported = server.find(objects.SUPPORTED_MODES)
    modes = [
        (Mode.PROFILE_POSITION, "profile position mode"),
        (Mode.CYCLIC_POSITION, "cyclic synchronous position mode"),
    ]
    has = [each for each in modes if supported is None or supported & each[0].supported_bit]
    if wraps:  # in profile position a drive may reach its target in either direction
        has = [each for each in has if each[0] is Mode.CYCLIC_POSITION]
        if not has:
            raise DriveRefused(
                f"{server.label}: positions wrap around (607B) within the limits of the drives "
                "file and there is no cyclic synchronous position mode (6502 = "
                f"{supported:08X}h, bit 7 is clear), needed for such an axis; home the drive "
                "to another zero, or switch 607B off with the maker's commissioning tool"
            )
    if not has:
        raise DriveRefused(
            f"{server.label}: neither profile position nor cyclic synchronous position mode "
            f"(6502 = {supported:08X}h, bits 0 and 7 are clear); velocity and torque modes hold "
            "no position: use a drive or firmware with one of these modes"
        )
    mode, name = has[0]
    server.put(objects.MODE, mode)
    if not wait(lambda: server.get(objects.MODE_DISPLAY) == mode, MODE_TIME):
        raise DriveRefused(
            f"{server.label}: does not take {name}: 6061 shows"
            f" {server.get(objects.MODE_DISPLAY)}, {MODE_TIME:g} s after {mode.value} was written"
            " to 6060; release it from the maker's tool or from another master"
        )
    return mode


def make_judge(
    axis: AxisDrive, drives: DrivesFile, requirements: Mapping[Entry, Requirement]
) -> Judge:
    """Return a judge of values kept by the drive of an axis, by the table of requirements.

    An object outside the table must read back exactly.

    Parameters
    ----------
    axis, drives : AxisDrive, DrivesFile
    requirements : mapping of Entry to Requirement
        Requirements of the bus.
    """
    counted = measures(axis)

    def judge(entry: Entry, written: int, kept: int) -> tuple[bool, str]:
        # the row of an array's first entry applies to the array
        need = requirements.get(entry) or requirements.get(replace(entry, subindex=1))
        if need is None:
            return False, ""
        accepted = need.kept.accepts(written, kept, drives)
        if need.quantity is None:
            return accepted, ""
        measure = counted[need.quantity]
        held, wanted = (f"{measure.value(count):.5g} {measure.unit}" for count in (kept, written))
        return accepted, f" ({held} instead of {wanted})"

    return judge


def find_swap(
    server: RemoteDictionary, axis: AxisDrive, pairs: Iterable[tuple[RemoteDictionary, AxisDrive]]
) -> str | None:
    """Return the entries that fit a drive in conflict with its own, with a remedy; None if none.

    With swapped node numbers each drive contradicts its entry, and a correction of ratings would
    be wrong. Hence identity (1018), motor, encoder and gear are compared with other entries whose
    own drives do not fit either.

    Parameters
    ----------
    server : RemoteDictionary
        The drive; only read.
    axis : AxisDrive
        Entry contradicted by the drive.
    pairs : iterable of (RemoteDictionary, AxisDrive)
        Drives with their entries.
    """
    fitting = [
        (there, other)
        for there, other in pairs
        if other.node != axis.node and fits(server, other) and not fits(there, other)
    ]
    if not fitting:
        return None
    names = " or ".join(f"{other.name} (node {other.node})" for _, other in fitting)
    hint = f"by identity and ratings this is the drive of {names}"
    swapped = [other.node for there, other in fitting if fits(there, axis)]
    if len(swapped) == 1:
        nodes = " and ".join(map(str, sorted((server.node, *swapped))))
        return f"{hint}: nodes {nodes} are swapped, exchange them in the drives file"
    return f"{hint}: correct the node numbers in the drives file"


def fits(server: RemoteDictionary, axis: AxisDrive) -> bool:
    """Return True if a drive confirms at least one statement of an entry and contradicts none."""
    looked_at = server.copy_through(lambda client: client)
    try:
        check_identity(looked_at, axis)
        found = {comparison.grade for comparison in comparisons(looked_at, axis)}
    except DriveError:
        return False
    return Grade.OK in found and Grade.REFUSED not in found
