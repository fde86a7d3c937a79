"""Commands about drives: output, refusals and questions."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from probing_bench import DRIVES
from rich.console import Console
from small_run import identified_run

from drivers.commissioning.verdict import Grade, Verdict
from hil.cli import commissioning
from hil.terminal.keys import Keys, TerminalOperator

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from command_line import Hil


@pytest.fixture
def file_with(tmp_path: Path) -> Callable[[str, str], Path]:
    """Return the manutec's drives file with the first `old` replaced."""

    def write(old: str, new: str) -> Path:
        text = DRIVES.read_text()
        assert old in text
        path = tmp_path / "manutec-r15.drives.yaml"
        path.write_text(text.replace(old, new, 1))
        return path

    return write


@pytest.mark.long
def test_an_identified_run_of_the_robot_shows_which_way_its_joints_turn(
    hil: Hil, tmp_path: Path
) -> None:
    model = ("--model", identified_run(tmp_path / "run"))
    status, out, _ = hil("drives", "check", "manutec-r15", *model, "--angle", 2, "--yes")
    assert status == 0
    assert re.search(r"ok +direction of the joint +confirmed, gravity", out)
    status, _, err = hil("drives", "check", "manutec-r15", "--axis", 2, *model, "--yes")
    assert status == 2
    assert "of the robot together" in " ".join(re.sub("│", " ", err).split())


def test_a_sound_axis_passes_and_every_line_has_its_grade(hil: Hil) -> None:
    status, out, _ = hil(
        "drives", "check", "manutec-r15", "--axis", "joint 3", "--angle", 2, "--yes"
    )
    assert status == 0
    assert "joint 3 (node 3)" in out
    assert "0 refused" in out
    assert "joint 1" not in out


def test_a_check_that_refuses_ends_with_a_status_that_is_not_zero(
    hil: Hil, file_with: Callable[[str, str], Path]
) -> None:
    path = file_with("gear_ratio: 105", "gear_ratio: 100")
    status, out, _ = hil("drives", "check", path, "--axis", 1, "--yes")
    assert status == 1
    assert "refused  gear (6091)" in out
    assert "-> correct gear_ratio" in out


def test_without_an_answer_nothing_is_powered_on(hil: Hil) -> None:
    status, out, err = hil("drives", "check", "manutec-r15", "--axis", 1)
    assert status == 1
    assert "Power on, and move one after the other" in out
    assert "nothing was powered on" in err


def test_an_answer_may_come_down_a_pipe(hil: Hil, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    status, out, _ = hil("drives", "jog", "manutec-r15", "joint 6", "--by", -1)
    assert status == 0
    assert "joint 6: from 0° to -" in out


def test_an_axis_that_does_not_exist_is_refused_with_those_that_do(hil: Hil) -> None:
    status, _, err = hil("drives", "jog", "manutec-r15", 7, "--by", 1)
    assert status == 2
    assert "joint 6" in err


def test_homing_needs_to_be_stated(hil: Hil, file_with: Callable[[str, str], Path]) -> None:
    stated = next(line for line in DRIVES.read_text().splitlines() if "homing:" in line)
    status, _, err = hil("drives", "home", file_with(f"{stated}\n", ""), 1, "--yes")
    assert status == 1
    assert "joint 1: homing is missing; state method" in err


def test_an_axis_homes_by_the_method_that_is_asked_for(hil: Hil) -> None:
    status, out, _ = hil("drives", "home", "manutec-r15", 5, "--method", 37, "--yes")
    assert status == 0
    assert "joint 5: homed by method 37, position 115°; off" in out


def test_the_monitor_ends_when_its_time_is_over(hil: Hil) -> None:
    status, out, _ = hil("drives", "monitor", "manutec-r15", "--for", 0.2)
    assert status == 0
    assert "no SYNC" in out
    assert "joint 6" in out


@pytest.mark.parametrize(
    "command",
    [
        ("drives", "check", "--axis", 6, "--angle", 1, "--yes"),
        ("drives", "jog", 6, "--by", 1, "--yes"),
        ("drives", "home", 6, "--yes"),
        ("drives", "monitor", "--for", 0.1),
    ],
)
def test_a_drives_file_by_another_name_finds_the_plant_of_its_robot(
    hil: Hil, tmp_path: Path, command: tuple[object, ...]
) -> None:
    path = tmp_path / "cell 7" / "my-drives.yaml"
    path.parent.mkdir()
    path.write_text(DRIVES.read_text().replace("gear_ratio: 105", "gear_ratio: 106", 1))
    status, out, err = hil(*command[:2], path, *command[2:])
    assert (status, err) == (0, "")
    assert "joint 6" in out


def test_a_drives_file_of_no_plant_needs_a_channel_and_says_so_in_one_line(
    hil: Hil, file_with: Callable[[str, str], Path]
) -> None:
    path = file_with("vendor: 0x4D2", "vendor: 0x2A")
    path = path.rename(path.with_name("cell7.yaml"))
    status, _, err = hil("drives", "check", path, "--yes")
    assert status == 1
    assert err == (
        f"{path}: no built-in plant has these drives; name a plant with --channel (manutec-r15), "
        "or a bus with --interface and --channel\n"
    )


def test_a_plant_may_be_named_for_any_drives_file(
    hil: Hil, file_with: Callable[[str, str], Path]
) -> None:
    path = file_with("vendor: 0x4D2", "vendor: 0x2A")
    status, out, _ = hil("drives", "check", path, "--axis", 1, "--channel", "manutec-r15", "--yes")
    assert status == 1
    assert "refused" in out
    assert "identity" in out


def test_a_channel_that_is_a_file_of_another_kind_is_refused_in_a_few_lines(hil: Hil) -> None:
    status, _, err = hil("drives", "monitor", "manutec-r15", "--channel", DRIVES)
    assert status == 1
    assert len(err.splitlines()) <= 7
    assert "more" in err


def test_a_name_of_nothing_is_refused_with_the_robots_that_come_along(hil: Hil) -> None:
    status, _, err = hil("drives", "check", "manutec")
    assert status == 1
    assert err == (
        "manutec: is neither a built-in robot (manutec-r15) nor a drives file; name one of these"
        " robots, or the path of a drives file\n"
    )


def test_a_bus_that_is_not_the_plant_needs_a_channel(hil: Hil) -> None:
    status, _, err = hil("drives", "monitor", "manutec-r15", "--interface", "socketcan")
    assert status == 2
    assert "needs a channel" in err


def test_lines_are_counted_by_grade_and_one_refusal_is_enough() -> None:
    console = Console(file=io.StringIO(), width=120)
    good = Verdict(Grade.OK, "joint 1", "gear", "105")
    bad = Verdict(Grade.REFUSED, "joint 1", "gear", "[100]", "file: 105", "correct it")
    assert commissioning.show_verdicts([good, good], console)
    assert not commissioning.show_verdicts([good, bad], console)
    shown = console.file.getvalue()
    assert "1 ok, 0 warning, 1 refused" in shown
    assert "[100]  (file: 105)" in shown


class Typing(Keys):
    """Keyboard with these keys pressed, one at each look."""

    def __init__(self, keys: str) -> None:
        super().__init__(io.StringIO())
        self.listening = True
        self._keys = iter(keys)

    def pressed(self) -> str:
        return next(self._keys, "")


@pytest.mark.parametrize(("key", "agrees"), [("y", True), ("Y", True), ("n", False), (" ", False)])
def test_only_y_agrees_to_motion(key: str, agrees: bool) -> None:
    console = Console(file=io.StringIO(), width=120)
    operator = TerminalOperator(console, Typing(key), agreed=False)
    assert operator.agrees("Power on?") is agrees
    assert ("stops all axes" in console.file.getvalue()) is agrees


def test_who_agreed_beforehand_is_asked_nothing_but_can_stop_all_the_same() -> None:
    operator = TerminalOperator(Console(file=io.StringIO()), Typing(" "), agreed=True)
    assert operator.agrees("Power on?")
    assert not operator.present
    assert operator.pressed() == " "


def test_the_command_states_that_no_drive_is_in_a_fault(hil: Hil) -> None:
    status, out, err = hil("drives", "reset-faults", "manutec-r15", "--yes")
    assert (status, err) == (0, "")
    assert out.count("SWITCH ON DISABLED") == 6


def test_the_reason_stands_above_what_could_not_be_switched_off(hil: Hil, tmp_path: Path) -> None:
    faults = tmp_path / "faults.yaml"
    faults.write_text("faults:\n  - {what: bus-off, axis: 2, at: {set_point: 3, after: 0.2}}\n")
    plan = tmp_path / "plan.yaml"
    hil("plan", "manutec-r15", "-o", plan)
    done = subprocess.run(  # noqa: S603 - our own program, whose log is on the terminal
        [sys.executable, "-m", "hil", "run", plan, "-o", tmp_path / "x", "--bus-option",
         f"faults={faults}"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    err = done.stderr
    reason, *below = err.splitlines()
    assert done.returncode == 1
    assert reason.startswith("joint 2 (node 2): no TPDO for 10 SYNCs in a row")
    assert any(line.startswith("powering off is incomplete, press the") for line in below)
    assert err.count("powering off is incomplete") == 1
