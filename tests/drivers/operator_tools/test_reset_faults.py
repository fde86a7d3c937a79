"""Faults of drives: listed without power, reset with consent; refused resets are named."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import local_drives
import pytest
from canopen_drive_bus import CanopenDriveBus
from local_bench import all_off, build, drives_file, never_energised
from probing_bench import Scripted

from drivers.canopen.bus import CanopenBus
from drivers.commissioning.verdict import Grade
from drivers.drive_bus import DriveFault, Move, MoveFailed
from drivers.operator_tools.check import check
from drivers.operator_tools.check_powered import SmallMoves, check_powered
from drivers.operator_tools.operator import StoppedByOperator
from drivers.operator_tools.reset_faults import reset_faults

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

OVER_CURRENT = 0x2310


@pytest.fixture
def can_bus() -> Iterator[Any]:
    """Three drives, the second with a fault."""
    with local_drives.LocalBus(3, {}) as bus:
        bus.drives[2].fail(OVER_CURRENT)
        bus.inbox.clear()
        yield bus


def test_a_fault_is_stated_with_its_cause_and_reset_once_somebody_agrees(can_bus: Any) -> None:
    operator = Scripted()
    found = list(reset_faults(CanopenBus(can_bus), drives_file(), operator))
    assert [str(each) for each in found] == [
        "joint 1 (node 1): state (6041): SWITCH ON DISABLED",
        "joint 2 (node 2): state (6041): FAULT: 2310 (continuous over-current)",
        "joint 3 (node 3): state (6041): SWITCH ON DISABLED",
        "joint 2 (node 2): reset: no fault any more, switched off",
    ]
    assert operator.shown == ["Cause removed: reset the fault of joint 2 (node 2)?"]
    assert can_bus.drives[2].words == [0, 0x80, 0]
    assert can_bus.drives[1].words == can_bus.drives[3].words == []
    assert never_energised(can_bus)
    with CanopenDriveBus(can_bus, drives_file()) as drive_bus:
        drive_bus.sample()


def test_without_consent_no_fault_is_reset(can_bus: Any) -> None:
    with pytest.raises(StoppedByOperator):
        list(reset_faults(CanopenBus(can_bus), drives_file(), Scripted(agreed=False)))
    assert can_bus.drives[2].words == []


def test_a_drive_that_another_master_holds_under_power_is_left_alone(can_bus: Any) -> None:
    can_bus.drives[3].go("enabled")
    found = list(reset_faults(CanopenBus(can_bus), drives_file(), Scripted()))
    assert "OPERATION ENABLED" in str(found[2])
    assert can_bus.drives[3].state == "enabled"


def test_a_fault_that_comes_back_is_refused_with_its_cause(can_bus: Any) -> None:
    can_bus.drives[2].stuck.add("fault")
    *_, last = reset_faults(CanopenBus(can_bus), drives_file(), Scripted())
    assert last.grade is Grade.REFUSED
    assert "the fault returns after a reset: 2310" in last.found


def test_a_run_on_a_drive_in_a_fault_names_the_command_that_resets_it(can_bus: Any) -> None:
    with pytest.raises(DriveFault, match=r"FAULT: 2310 .*reset the fault \(hil drives reset-faul"):
        CanopenDriveBus(can_bus, drives_file()).__enter__()
    assert all_off(can_bus)


def test_a_check_lists_a_drive_in_a_fault_before_anything_is_powered(can_bus: Any) -> None:
    verdicts = list(check(CanopenBus(can_bus), drives_file(), SmallMoves(), Scripted()))
    (fault,) = [each for each in verdicts if each.check == "state (6041)" and each.remedy]
    assert fault.grade is Grade.REFUSED
    assert str(fault).startswith("joint 2 (node 2): state (6041): FAULT: 2310")
    assert never_energised(can_bus)


def test_what_a_check_was_refused_is_named_and_so_is_the_axis() -> None:
    can_bus, _ = build({2: {(0x60FD, 0): ("u32", 8)}})
    can_bus.drives[2].stuck.add("off")
    with can_bus:
        *_, last = check_powered(CanopenBus(can_bus), drives_file(), SmallMoves(), Scripted())
    assert (last.grade, last.place, last.check) == (Grade.REFUSED, "joint 2 (node 2)", "power-on")
    assert last.found.startswith("safe torque off is active")


def test_a_motion_that_fails_is_named_by_its_axis() -> None:
    can_bus, _ = build()
    can_bus.drives[2].deaf_to_set_points = True
    with can_bus:
        *_, last = check_powered(CanopenBus(can_bus), drives_file(), SmallMoves(), Scripted())
    assert (last.place, last.check) == ("joint 2 (node 2)", "small move of joint 2")
    assert all_off(can_bus)


def test_an_axis_on_its_target_whose_drive_does_not_say_so_is_no_brake() -> None:
    can_bus, drive_bus = build()
    kept = type(can_bus.drives[2]).statusword
    with can_bus, pytest.MonkeyPatch.context() as patch, drive_bus:
        drive_bus.move({1: Move(0.01, 0.5, 2.0)})
        patch.setattr(type(can_bus.drives[2]), "statusword", property(unreached(kept)))
        with pytest.raises(MoveFailed) as caught:
            deque((drive_bus.sample() for _ in range(3000)), maxlen=0)
    assert "does not show target reached (6041 bit 10)" in str(caught.value)
    assert "brake" not in str(caught.value)


def unreached(kept: property) -> Callable[[Any], int]:
    assert kept.fget is not None
    shown = kept.fget
    return lambda drive: shown(drive) & ~0x0400
