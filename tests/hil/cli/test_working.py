"""A command that is silent for seconds first states its work on the terminal."""

from __future__ import annotations

import importlib
import pkgutil
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest
from rich.text import Text
from small_run import write_run
from terminal import Terminal

import hil as package
from checked_files.yaml_file import FileError
from hil.planning.plan import dump_plan
from hil.terminal.console import out, working

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil
    from conftest import ChainBuilder

    from hil.model.robot import Robot
    from hil.planning.plan import Plan

ESTIMATING = "estimating manutec-r15 from 39 measurements"
LIMITS = "checking the plan's motions against the limits"
LONG = [
    ("robot manutec-r15", "model.base_parameters.base_parameters",
     "finding the base parameters of 6 joints"),
    ("plan manutec-r15 -o NEW", "planning.design.by_counts.design", "choosing measurements"),
    ("plan manutec-r15 --minutes 5 -o NEW", "planning.design.by_minutes.design_within",
     "choosing the most informative measurements in 5 minutes"),
    ("plan --refine RUN -o NEW", "results.identification.experience",
     "reading earlier runs"),
    ("plan manutec-r15 --kind trajectory -o NEW", "planning.design.trajectories.design_trajectory",
     "optimising a trajectory of 6 axes and 15 harmonics"),
    ("dry-run PLAN", "tasks.measuring.checked", LIMITS),
    ("dry-run PLAN", "planning.prediction.information.predict", "predicting the precision"),
    ("view PLAN", "view.page.write_page", "making the page"),
    ("run PLAN -o NEW", "tasks.measuring.checked", LIMITS),
    ("run PLAN --symmetric RUN -o NEW", "commands.friction.refuse_asymmetric",
     "testing the friction of"),
    ("identify RUN", "results.identification.identified", ESTIMATING),
    ("report RUN", "report.page.report", "identifying manutec-r15 and drawing the report"),
    ("diagnose RUN", "commands.diagnose.diagnose",
     "testing for effects missing in the robot file of manutec-r15"),
    ("validate RUN --truth manutec-r15", "ground_truth.comparison.truth_comparison",
     "comparing the estimate of manutec-r15 with the truth"),
    ("friction RUN", "commands.friction.fit_friction", "fitting friction models"),
    ("payload RUN RUN", "results.load.LoadProblem.fit", "estimating both runs and the load"),
    ("payload measure --model RUN -o NEW", "results.load.estimated",
     "reading the run without the load"),
    ("history RUN", "commands.history.read_history", "comparing 1 runs"),
    ("history RUN --identify", "results.findings.found_in", "identifying"),
    ("validate RUN --model RUN", "results.model.Model.load", "reading the model"),
    ("export RUN --to json -o NEW", "results.model.Model.load", "reading the model"),
    ("accept RUN --draft -o NEW", "results.model.Model.load", "reading the run"),
    ("track PLAN --model RUN -o NEW", "results.model.Model.load",
     "predicting the torques of the plan"),
    ("watch PLAN --model RUN -o NEW", "results.model.Model.load", "reading plan and model"),
]  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def everything_loaded() -> None:
    """Load all modules, because a module imported later would keep a patched object."""
    for module in pkgutil.walk_packages(package.__path__, "hil."):
        if not module.name.rpartition(".")[2].startswith("_"):  # a library in C is no module
            importlib.import_module(module.name)


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the console treat the output as a terminal."""
    monkeypatch.setattr(out, "_force_terminal", True)
    monkeypatch.setattr(out, "is_interactive", True)


def shown(text: str) -> str:
    """Return text without colours and cursor motions."""
    return Text.from_ansi(text.replace("\r", "\n")).plain


@pytest.mark.usefixtures("terminal")
@pytest.mark.parametrize(("line", "long", "words"), LONG)
def test_what_takes_long_is_stated_before_it_begins(
    hil: Hil,
    tmp_path: Path,
    manutec: Robot,
    small_plan: Plan,
    monkeypatch: pytest.MonkeyPatch,
    line: str,
    long: str,
    words: str,
) -> None:
    run, plan = tmp_path / "run", tmp_path / "plan.yaml"
    if "RUN" in line:
        write_run(run, manutec)
    plan.write_text(dump_plan(small_plan))

    def stop(*_: object, **__: object) -> None:
        raise FileError("so far")

    monkeypatch.setattr(f"hil.{long}", stop)
    places = {"RUN": run, "PLAN": plan, "NEW": tmp_path / "new"}
    status, printed, err = hil(*(places.get(word, word) for word in line.split()))
    assert (status, "so far" in err) == (1, True), err
    assert words in shown(printed)


@pytest.mark.usefixtures("terminal", "wide_console")
def test_the_line_states_how_long_it_has_taken_and_goes_in_the_end(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    times = [0.0]
    monkeypatch.setattr(out, "get_time", lambda: times[0])
    with working("weighing [links]") as now:
        times[0] = 33.0
        now("weighing \x1b[31mlinks")
    printed = capsys.readouterr().out
    assert "weighing [links] 0:00:00" in shown(printed)
    assert "links 0:00:33" in shown(printed)
    assert "\x1b[31mlinks" not in printed
    assert printed.rstrip().endswith("\x1b[2K")


def test_without_a_terminal_nothing_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with working("weighing links") as now:
        now("weighing motors")
    assert capsys.readouterr() == ("", "")


def test_an_interrupt_leaves_the_terminal_as_it_was(tmp_path: Path) -> None:
    screen = Terminal()
    program = subprocess.Popen(
        [sys.executable, "-m", "hil", "plan", "manutec-r15", "--minutes", "60", "-o", "plan.yaml"],
        stdout=screen.theirs,
        stderr=screen.theirs,
        cwd=tmp_path,
    )
    screen.begin()
    deadline = time.monotonic() + 60
    while "choosing" not in screen.shown and time.monotonic() < deadline:
        time.sleep(0.02)
    program.send_signal(signal.SIGINT)
    assert program.wait(timeout=30) == 130
    screen.close()
    hidden, shown_again = screen.shown.rfind("\x1b[?25l"), screen.shown.rfind("\x1b[?25h")
    assert 0 <= hidden < shown_again
    assert not (tmp_path / "plan.yaml").exists()


@pytest.mark.long
def test_a_robot_of_thirty_joints_is_shown_without_a_table_that_nobody_can_read(
    hil: Hil, tmp_path: Path, chains: ChainBuilder
) -> None:
    turned = [chains.joint(alpha="pi/2" if k % 2 else 0, d=0.2, r=0.1) for k in range(30)]
    file = tmp_path / "snake.yaml"
    file.write_text(chains.robot(*turned).text)
    status, printed, complaint = hil("robot", file)
    assert (status, complaint) == (0, "")
    assert "base parameters" in printed
    assert "has 30 columns, at most 12 are shown" in printed
