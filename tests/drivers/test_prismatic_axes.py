"""Values of prismatic axes are stated in metres and newtons in all outputs."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import local_drives
import numpy as np
import pytest
from canopen_drive_bus import CanopenDriveBus
from fake_fieldbus import axes_of
from local_bench import NODES, drives_file

from drivers.axis import AxisScale
from drivers.canopen.rules import REQUIREMENTS
from drivers.cia402 import objects
from drivers.cia402.set_point_limits import check_path
from drivers.commissioning.configure import make_judge
from drivers.drive_bus import DriveError, LimitExceeded, Move

if TYPE_CHECKING:
    from collections.abc import Callable

    Act = Callable[[Any, CanopenDriveBus], None]

DRIVES = drives_file(joint="prismatic")
PER_METRE = 1 / abs(AxisScale.derive(DRIVES.axes[0]).position)
OF_ROTATION = re.compile(r"\brad\b|N m\b")


def session(act: Act, changes: dict[tuple[int, int], Any] | None = None) -> str:
    """Return all text of a session about a prismatic axis, its error last."""
    can_bus = local_drives.LocalBus(NODES, {1: changes or {}})
    drive_bus = CanopenDriveBus(can_bus, DRIVES)
    error = ""
    with can_bus:
        try:
            with drive_bus:
                act(can_bus.drives[1], drive_bus)
        except DriveError as raised:
            error = str(raised)
    return "\n".join((*drive_bus.notes, error))


def samples(drive_bus: CanopenDriveBus) -> None:
    for _ in range(2000):
        drive_bus.sample()


def nothing(_drive: Any, _drive_bus: CanopenDriveBus) -> None:
    return None


def leaves_its_place(drive: Any, drive_bus: CanopenDriveBus) -> None:
    drive.immobile = True
    for _ in range(20):
        drive.position += 0.005 * PER_METRE
        drive_bus.sample()


def jumps(drive: Any, drive_bus: CanopenDriveBus) -> None:
    drive_bus.move({0: Move(1.0, 1.0, 10.0)})
    for _ in range(50):
        drive_bus.sample()
    drive.position += 0.3 * PER_METRE
    samples(drive_bus)


def is_blocked(drive: Any, drive_bus: CanopenDriveBus) -> None:
    drive.node.set_data(0x6078, 0, (2900).to_bytes(2, "little"))
    samples(drive_bus)


def moves(move: Move) -> Act:
    return lambda _, drive_bus: drive_bus.move({0: move})


def sags(drive: Any, _drive_bus: CanopenDriveBus) -> None:
    drive.sags = 0.01 * PER_METRE


def is_enabled_on_and_on(drive: Any, drive_bus: CanopenDriveBus) -> None:
    drive_bus.move({0: Move(1.0, 1.0, 10.0)})
    drive.stays_stopped = True
    drive.step = lambda: setattr(drive, "position", drive.position + 0.004 * PER_METRE)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (leaves_its_place, " m, outside -0.05 ... 0.05 m around the set-point"),
        (jumps, "m/s, at most 2.6 m/s allowed"),
        (is_blocked, ": 290 N for "),
        (moves(Move(9.0, 1.0, 1.0)), "target 9 m must be in [-2, 2] m;"),
        (moves(Move(1.0, 9.0, 1.0)), "velocity 9 m/s must be above 0"),
        (moves(Move(1.0, 1.0, 99.0)), "acceleration 99 m/s^2 must be above 0"),
        (sags, "sagged by 0.01 m after its voltage was off, at most 0.001 m"),
        (is_enabled_on_and_on, " m, at most "),
    ],
)
def test_errors_of_a_session_are_in_metres(act: Act, words: str) -> None:
    stated = session(act)
    assert words in stated
    assert not OF_ROTATION.search(stated)


def test_an_axis_that_stands_outside_does_so_by_metres() -> None:
    can_bus = local_drives.LocalBus(NODES, {})
    can_bus.drives[1].position = 3 * PER_METRE
    with can_bus, pytest.raises(LimitExceeded, match=r"at 3 m, must be in \[-2, 2\] m;") as caught:
        CanopenDriveBus(can_bus, DRIVES).__enter__()
    assert not OF_ROTATION.search(str(caught.value))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({(0x607D, 1): ("i32", -65_190), (0x607D, 2): ("i32", 65_190)}, "[-2, 2] m; used:"),
        ({(0x607F, 0): ("u32", 65_190)}, "is 1 m/s, tighter"),
        ({(0x6085, 0): ("u32", 65_190)}, "quick stop ramp 1 m/s^2"),
        ({(0x6072, 0): ("u16", 1000)}, "is 100 N, tighter"),
        ({(0x607D, 1): ("i32", 10**6), (0x607D, 2): ("i32", 10**7)}, "[-2, 2] m do not"),
    ],
)
def test_limits_of_a_drive_are_stated_in_metres(
    changes: dict[tuple[int, int], Any], words: str
) -> None:
    stated = session(nothing, changes)
    assert words in stated
    assert not OF_ROTATION.search(stated)


def test_software_limits_that_are_fixed_are_stated_in_metres() -> None:
    can_bus = local_drives.LocalBus(NODES, {})
    drive = can_bus.drives[1]
    for subindex, end in ((1, -(2**30)), (2, 2**30)):
        drive.node.set_data(0x607D, subindex, end.to_bytes(4, "little", signed=True))
    drive.forbids = lambda index, *_: 0x06010002 if index == 0x607D else None
    drive_bus = CanopenDriveBus(can_bus, DRIVES)
    with can_bus, drive_bus:
        stated = "\n".join(drive_bus.notes)
    assert " m, those of the drives file are [-2, 2] m:" in stated
    assert not OF_ROTATION.search(stated)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ([0.0, 9.0], "set-point 9 m after"),
        ([0.0, 0.1], "velocity 25 m/s after"),
        ([0.0, 0.001], "acceleration 62.5 m/s^2 after"),
        ([1.0, 1.0], "begins at 1 m, the axis is at 0 m"),
    ],
)
def test_paths_are_refused_in_metres(path: list[float], words: str) -> None:
    with pytest.raises(LimitExceeded) as caught:
        check_path(np.array([path]).T, axes_of(DRIVES.axes[:1]), [0.0], 0.004)
    assert words in str(caught.value)
    assert not OF_ROTATION.search(str(caught.value))


def test_what_a_drive_keeps_instead_is_stated_in_metres() -> None:
    judge = make_judge(DRIVES.axes[0], DRIVES, REQUIREMENTS)
    counts = 2 * round(PER_METRE), round(PER_METRE)
    for entry, unit in (
        (objects.SOFTWARE_LIMIT_MAX, "m"),
        (objects.MAX_PROFILE_VELOCITY, "m/s"),
        (objects.QUICK_STOP_DECELERATION, "m/s^2"),
        (objects.FOLLOWING_ERROR_WINDOW, "m"),
    ):
        stated = judge(entry, *counts)[1]
        assert re.fullmatch(rf" \(1(\.\d+)? {re.escape(unit)} instead of 2(\.\d+)? .*\)", stated)
        assert not OF_ROTATION.search(stated)
    assert " N instead of " in judge(objects.MAX_TORQUE, *counts)[1]
