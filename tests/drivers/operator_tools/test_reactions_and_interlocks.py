"""Reactions of drives to faults, and conditions that prevent switching on, checked beforehand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import can
import local_drives
import pytest
from canopen_drive_bus import CanopenDriveBus
from local_bench import axis, build, never_energised
from probing_bench import Scripted, drives_of

from drivers.canopen.bus import CanopenBus
from drivers.canopen.monitor import BusPicture, questions
from drivers.cia402.supervision import safe_torque_off
from drivers.commissioning.verdict import Grade
from drivers.drive_bus import DriveError, DriveRefused, Move
from drivers.drives_file import DrivesFile
from drivers.operator_tools.check import check
from drivers.operator_tools.check_objects import check_reactions
from drivers.operator_tools.check_powered import SmallMoves

if TYPE_CHECKING:
    from pathlib import Path

    from drivers.commissioning.verdict import Verdict

Objects = dict[tuple[int, int], Any]
LOCKED = "safe torque off is active (60FD = 00000008h: bit 3, interlock)"


def stated(objects: Objects, **changes: Any) -> list[Verdict]:
    drives = DrivesFile.model_validate({"bitrate": 1_000_000, "axes": [axis(1, **changes)]})
    with local_drives.LocalBus(1, {1: objects}) as bus:
        (server,) = CanopenBus(bus).unpowered(drives).servers
        return list(check_reactions(server, drives.axes[0]))


@pytest.mark.parametrize(
    ("index", "option", "grade", "words"),
    [
        (
            0x605E,
            0,
            Grade.WARNING,
            "0, takes the torque away; on a fault the axis coasts, and a hanging axis",
        ),
        (0x605C, 0, Grade.WARNING, "when it is switched off the axis coasts, and a hanging axis"),
        (0x605B, 0, Grade.WARNING, "when it is shut down the axis coasts"),
        (0x605A, 0, Grade.WARNING, "hil run overwrites this option"),
        (0x6007, 0, Grade.WARNING, "0, does nothing; on loss of the bus the axis keeps m"),
        (0x6007, 2, Grade.WARNING, "2, takes the torque away; on loss of the bus the axi"),
        (0x605E, 2, Grade.OK, "2, slows down on the quick stop ramp"),
        (0x605C, 1, Grade.OK, "1, slows down on the ramp"),
        (0x605C, 2, Grade.OK, "2, specific to the maker, see the drive's manual"),
        (0x605A, 6, Grade.OK, "6, slows down on the quick stop ramp and stays powered"),
        (0x605E, -1, Grade.OK, "-1, specific to the maker, see the drive's manual"),
        (0x6007, 3, Grade.OK, "3, makes a quick stop"),
    ],
)
def test_a_drive_that_merely_coasts_is_stated_with_the_consequence(
    index: int, option: int, grade: Grade, words: str
) -> None:
    found = [v for v in stated({(index, 0): ("i16", option)}) if f"{index:04X}" in v.check]
    assert [v.grade for v in found] == [grade]
    assert words in str(found[0])


def test_of_options_that_a_drive_does_not_have_nothing_is_stated() -> None:
    lacking: Objects = dict.fromkeys([(0x6007, 0), (0x605A, 0)])
    assert stated(lacking) == []


@pytest.mark.parametrize(("delay", "grade"), [(0.05, Grade.OK), (0.04, Grade.WARNING)])
def test_a_brake_that_takes_longer_than_the_voltage_stays_is_stated(
    delay: float, grade: Grade
) -> None:
    maxon = {"vendor": 0xFB, "product": 0x402}
    brake: Objects = {(0x3158, 2): ("u16", 50)}
    found = stated(brake, identity=maxon, brake_delay=delay)[-1]
    assert f"brake (3158:02): 0.05 s (file: {delay:g} s)" in str(found)
    assert found.grade is grade
    assert not any("brake" in str(v) for v in stated(brake))


@pytest.mark.parametrize(
    ("objects", "found"),
    [
        ({(0x60FD, 0): ("u32", 8)}, LOCKED),
        ({(0x60FD, 0): ("u32", 0x10008)}, "60FD = 00010008h"),
        ({(0x60FD, 0): ("u32", 0xFFFF0007)}, None),
        ({}, None),
        ({(0x60FD, 0): ("u16", 8)}, None),
        ({(0x603F, 0): ("u16", 0x5441)}, "safe torque off is active (603F = 5441h)"),
        ({(0x603F, 0): ("u16", 0x2310), (0x60FD, 0): ("u32", 8)}, LOCKED),
    ],
)
def test_safe_torque_off_is_named_by_what_the_drive_shows(
    objects: Objects, found: str | None
) -> None:
    drives = DrivesFile.model_validate({"bitrate": 1_000_000, "axes": [axis(1)]})
    with local_drives.LocalBus(1, {1: objects}) as bus:
        (server,) = CanopenBus(bus).unpowered(drives).servers
        said = safe_torque_off(server)
    assert (said is None) == (found is None)
    assert found is None or found in str(said)


def test_a_drive_that_answers_nothing_is_not_said_to_be_locked() -> None:
    drives = DrivesFile.model_validate({"bitrate": 1_000_000, "axes": [axis(1)]})
    with local_drives.LocalBus(1, {1: {(0x60FD, 0): ("u32", 8)}}) as bus:
        (server,) = CanopenBus(bus).unpowered(drives).servers
        bus.drives[1].powered = False
        assert safe_torque_off(server) is None


def test_a_drive_that_does_not_switch_on_says_why_if_it_can() -> None:
    can_bus, drive_bus = build({3: {(0x60FD, 0): ("u32", 8)}})
    with can_bus:
        can_bus.drives[3].stuck.add("off")
        with pytest.raises(DriveRefused) as stated:
            drive_bus.__enter__()
        assert never_energised(can_bus)
    assert f"joint 3 (node 3): {LOCKED}, so that " in str(stated.value)
    assert "stays in" not in str(stated.value)


@pytest.fixture
def guarded(tmp_path: Path) -> str:
    """Fault plan with the guard of joint 2 open for the first four seconds."""
    return faults(tmp_path, "{what: sto-active, axis: 2, at: {time: 0}, lasts: {time: 4}}")


def faults(folder: Path, fault: str) -> str:
    path = folder / "faults.yaml"
    path.write_text(f"faults:\n  - {fault}\n")
    return str(path)


def sample_for(axes: CanopenDriveBus, count: int) -> None:
    for _ in range(count):
        axes.sample()


def plant(path: str) -> can.BusABC:
    return can.Bus("manutec-r15", "sim_plant", ignore_config=True, faults=path)


def test_an_open_guard_is_found_by_check_before_anything_is_powered(guarded: str) -> None:
    with plant(guarded) as bus:
        verdicts = check(CanopenBus(bus), drives_of(1, 2), SmallMoves(), Scripted(agreed=False))
        found = {}
        with pytest.raises(DriveError, match="did not agree"):
            found.update((v.place, v) for v in verdicts if v.check.startswith("interlock"))
    assert found["joint 1 (node 1)"].grade is Grade.OK
    assert found["joint 2 (node 2)"].grade is Grade.WARNING
    assert LOCKED in found["joint 2 (node 2)"].found


def test_the_plant_stays_off_behind_an_open_guard_and_serves_when_it_is_closed(
    guarded: str,
) -> None:
    with plant(guarded) as bus:
        with pytest.raises(DriveRefused) as stated:
            CanopenDriveBus(bus, drives_of(1, 2)).__enter__()
        assert f"joint 2 (node 2): {LOCKED}" in str(stated.value)
        unpowered = CanopenBus(bus).unpowered(drives_of(2))
        unpowered.wait(4.0)
        assert safe_torque_off(unpowered.servers[0]) is None
        with CanopenDriveBus(bus, drives_of(1, 2)) as axes:
            assert axes.sample().reached


def test_a_guard_that_is_opened_in_the_middle_of_a_move_stops_all_axes(tmp_path: Path) -> None:
    path = faults(tmp_path, "{what: sto-active, axis: 2, at: {set_point: 1, after: 0.2}}")
    with plant(path) as bus, CanopenDriveBus(bus, drives_of(1, 2)) as axes:
        axes.move({0: Move(0.5, 0.5, 2.0), 1: Move(0.3, 0.5, 2.0)})
        with pytest.raises(DriveError, match=r"joint 2 \(node 2\): left OPERATION ENABLED"):
            sample_for(axes, 1000)


def test_the_monitor_shows_what_the_drives_answer_to_whoever_asks(guarded: str) -> None:
    drives = drives_of(1, 2)
    picture = BusPicture(drives)
    with plant(guarded) as bus:
        for question in questions(drives):
            bus.send(question)
        while (frame := bus.recv(0)) is not None:
            picture.take(frame, 1.0)
    assert [axis.interlock for axis in picture.axes] == ["", LOCKED]
