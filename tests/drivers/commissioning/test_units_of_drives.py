"""Drives with unusual units: drafted, checked and commissioned with one scale, or refused."""

from __future__ import annotations

import math
import re
from typing import Any

import local_drives
import pytest
import yaml
from canopen_drive_bus import CanopenDriveBus
from data_sheets import sheet
from local_bench import axis, never_energised
from unit_dictionaries import HABITS, Habit, make_sheet, words

from checked_files.yaml_file import UNSTATED
from drivers.axis import AxisScale
from drivers.canopen.bus import CanopenBus
from drivers.canopen.eds_file import parse_eds
from drivers.canopen.rules import RULES
from drivers.commissioning.verdict import Grade, Verdict
from drivers.dictionary.review import review
from drivers.drive_bus import DriveRefused
from drivers.drives_file import DrivesFile
from drivers.operator_tools.check_objects import check_scaling
from drivers.operator_tools.draft import DraftedAxis, draft_drives

NAMES = tuple(HABITS)
KEYS = (
    "increments_per_revolution",
    "velocity_unit",
    "acceleration_unit",
    "rated_current",
    "rated_torque",
)
WRONG = [(name, *case) for name in NAMES for case in HABITS[name].wrong]


def drives(habit: Habit, **changes: Any) -> DrivesFile:
    # slow and narrow enough for every unit
    limits = {"q_min": -2, "q_max": 2, "velocity": 2, "acceleration": 20, "torque": 100}
    stated = {"limits": limits, "zero": 0} | habit.right | changes
    return DrivesFile.model_validate({"bitrate": 1_000_000, "axes": [axis(1, **stated)]})


def checked(habit: Habit, **changes: Any) -> list[Verdict]:
    stated = drives(habit, **changes)
    with local_drives.LocalBus(1, {1: habit.objects}) as bus:
        (server,) = CanopenBus(bus).unpowered(stated).servers
        return list(check_scaling(server, stated.axes[0]))


@pytest.mark.parametrize("name", NAMES)
def test_a_draft_states_what_the_drive_proves_and_nothing_else(name: str) -> None:
    habit = HABITS[name]
    dictionary = parse_eds(sheet(make_sheet(habit.objects)).encode(), "drive.dcf", 1)
    text = draft_drives([DraftedAxis(dictionary, review(dictionary, RULES), 1)], RULES)
    marked = set(re.findall(rf"(\w+): {UNSTATED}", text))
    read = yaml.safe_load(re.sub(rf"{UNSTATED} .*", "0", text))["axes"][0]
    stated = {key: None if key in marked else str(read[key]) for key in habit.drafted}
    assert stated == habit.drafted


@pytest.mark.parametrize("name", NAMES)
def test_the_right_file_is_taken_by_check_and_by_commissioning(name: str) -> None:
    habit = HABITS[name]
    verdicts = checked(habit)
    assert [str(v) for v in verdicts if v.grade is Grade.REFUSED] == []
    with (
        local_drives.LocalBus(1, {1: habit.objects}) as bus,
        CanopenDriveBus(bus, drives(habit)) as drive_bus,
    ):
        bus.drives[1].position = bus.drives[1].target = 100.0
        q = drive_bus.sample().q[0]
        noted = list(drive_bus.notes)
    counts = float(drives(habit).axes[0].increments_per_revolution)
    assert q == pytest.approx(100 * 2 * math.pi / counts / 100)
    doubts = [str(v) for v in verdicts if v.grade is Grade.WARNING]
    assert trusted(noted) == trusted(doubts) == habit.trusted


def trusted(lines: list[str]) -> set[str]:
    """Return keys of the drives file that cannot be verified."""
    return {
        key for key in KEYS for line in lines if re.search(rf"\b{key}\b[^;]* is not verified", line)
    }


@pytest.mark.parametrize(("name", "wrong", "words"), WRONG)
def test_a_file_that_contradicts_the_drive_is_refused_by_both_before_anything_is_powered(
    name: str, wrong: dict[str, Any], words: str
) -> None:
    habit = HABITS[name]
    found = [v for v in checked(habit, **wrong) if v.grade is Grade.REFUSED]
    assert len(found) >= 1
    with local_drives.LocalBus(1, {1: habit.objects}) as bus:
        with (
            pytest.raises(DriveRefused) as stated,
            CanopenDriveBus(bus, drives(habit, **wrong)),
        ):
            pytest.fail("the drive was accepted")
        assert never_energised(bus)
    assert words in str(stated.value)


def test_an_object_of_another_length_is_left_out_and_noted() -> None:
    habit = HABITS["factors of 1 behind an encoder"]
    odd = habit.objects | {(0x6093, 1): ("u16", 8), (0x6093, 2): ("u16", 1)}
    with (
        local_drives.LocalBus(1, {1: odd}) as bus,
        CanopenDriveBus(bus, drives(habit)) as drive_bus,
    ):
        assert any("6093:01" in note and "left out" in note for note in drive_bus.notes)


@pytest.mark.parametrize(
    ("velocity", "gear_ratio", "refused"),
    [("mm/s", 628.3, False), ("inc/s", 628.3, False), ("inc/s", 62.83, True), ("m/s", 628.3, True)],
)
def test_lengths_per_second_are_those_that_the_spindle_makes_of_revolutions(
    velocity: str, gear_ratio: float, refused: bool
) -> None:
    # 10 mm in a revolution of 10 counts: one count per second is 1 mm/s
    spindle = Habit(words(x6092_1=10, x6092_2=1, x60A9=0xFD010300), {}, {}, [])
    changes = {"joint": "prismatic", "increments_per_revolution": 10}
    found = checked(spindle, **changes, gear_ratio=gear_ratio, velocity_unit=velocity)
    (unit,) = [v for v in found if v.check == "SI unit velocity (60A9)"]
    assert unit.grade is (Grade.REFUSED if refused else Grade.OK)


def test_a_position_in_millidegrees_is_the_angle_that_the_joint_turned() -> None:
    # 0.001 degree at the gear output, which is the joint: no other conversion
    habit = HABITS["millidegrees behind a gear"]
    scale = AxisScale.derive(drives(habit, gear_ratio=100).axes[0])
    assert scale.position_from_counts(90_000.0) == pytest.approx(math.pi / 2)


CURRENT = axis(1)["current"]
MILLIAMPERE = {"current": CURRENT | {"basis": "mA"}}
OF_TORQUE = {
    "current": {"index": 0x6077, "type": "i16", "basis": "per mille of rated torque"},
}


@pytest.mark.parametrize(
    ("index", "changes", "words"),
    [
        (0x6075, {}, "rated current (6075) is 0, not configured, the drives file states rated_cur"),
        (0x6075, OF_TORQUE, "motor rated current (6075) is 0, not configured"),
        (
            0x6076,
            {},
            "motor rated torque (6076) is 0, not configured, the drives file states rated",
        ),
        (0x6076, MILLIAMPERE, "reference of 6072: set it with the maker's commissioning tool"),
    ],
)
def test_a_rating_of_0_is_refused_as_not_configured_where_per_mille_refer_to_it(
    index: int, changes: dict[str, Any], words: str
) -> None:
    habit = Habit({(index, 0): ("u32", 0), (0x6077, 0): ("i16", 0)}, {}, {}, [])
    with local_drives.LocalBus(1, {1: habit.objects}) as bus:
        with pytest.raises(DriveRefused) as caught:
            CanopenDriveBus(bus, drives(habit, **changes)).__enter__()
        assert never_energised(bus)
    assert words in str(caught.value)
    assert any("0, not configured" in str(v) for v in checked(habit, **changes))


def test_a_rated_current_of_0_leaves_the_file_on_trust_where_currents_are_in_milliampere() -> None:
    habit = Habit({(0x6075, 0): ("u32", 0)}, {}, {}, [])
    with (
        local_drives.LocalBus(1, {1: habit.objects}) as bus,
        CanopenDriveBus(bus, drives(habit, **MILLIAMPERE)) as drive_bus,
    ):
        noted = list(drive_bus.notes)
    assert any("(motor rated current) is 0, not configured: rated_current is" in n for n in noted)
    assert "rated_current" in trusted(noted)
    assert not any(v.grade is Grade.REFUSED for v in checked(habit, **MILLIAMPERE))
