"""Common properties of all commands: valid examples, output options, exit statuses."""

from __future__ import annotations

import json
import logging
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from every_command import every_command
from small_run import write_run

from hil.cli import EXAMPLES, STATUSES, arguments, examples_of
from hil.cli.outputs import Status
from hil.estimation.identify import METHODS
from hil.export.formats import FORMATS, RECORDINGS, SIMULATORS
from hil.model.robot import Robot, available_robots
from hil.terminal.console import out

if TYPE_CHECKING:
    from command_line import Hil

EVERY = every_command()
LEAVES = [name for name, command in EVERY.items() if not hasattr(command, "commands")]
ROOT = Path(__file__).parents[3]


def calls() -> list[str]:
    lines = [line for lines in EXAMPLES.values() for line in lines]
    return [call for line in lines for call in line.split(" && ")]


def test_each_command_has_examples_and_nothing_else_has() -> None:
    assert set(EXAMPLES) == {"", *LEAVES}
    assert all(len(examples_of(name)) == 2 for name in EVERY)


@pytest.mark.parametrize("name", EVERY)
def test_help_shows_two_examples(name: str, hil: Hil, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("typer.rich_utils.MAX_WIDTH", 200)
    shown = re.sub(r" \\ *\n +", " ", hil(*name.split(), "--help")[1])
    assert all(line in shown for line in examples_of(name))
    assert shown.count(" hil ") >= 2 + 1  # the usage, too


@pytest.mark.parametrize("line", calls())
def test_an_example_is_a_command_line_that_is_understood(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("runs").mkdir()
    words = shlex.split(line)[1:]
    command = EVERY[words.pop(0)]
    while hasattr(command, "commands"):
        context = command.make_context("hil", list(words))
        name, command, words = command.resolve_command(
            context, [*context._protected_args, *context.args]
        )
    command.make_context(name if words is None else "hil", list(words))


@pytest.mark.parametrize("words", [(), ("drives",), ("plan",), ("run",)])
def test_no_flag_looks_as_if_a_value_followed(hil: Hil, words: tuple[str, ...]) -> None:
    shown = hil(*words, "--help")[1]
    assert "--help" in shown
    assert "bool" not in shown.lower()


def test_the_statuses_are_those_that_commands_end_with(hil: Hil) -> None:
    assert {int(each) for each in Status} < set(STATUSES)
    shown = hil("--help")[1]
    assert all(re.search(rf"(?m)^ +{status}  \w", shown) for status in STATUSES)


def test_names_complete_as_they_are_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(arguments.METHODS) == set(METHODS)
    assert set(arguments.FORMATS) == {*FORMATS, *SIMULATORS, *RECORDINGS}
    monkeypatch.chdir(tmp_path)
    assert arguments.robots("") == sorted(available_robots())
    (tmp_path / "runs" / "first").mkdir(parents=True)
    (tmp_path / "runs" / "first" / "run.json").touch()
    (tmp_path / "runs" / "second").mkdir()
    (tmp_path / "plan.yaml").touch()
    assert arguments.runs("ru") == ["runs/"]
    assert arguments.runs("runs/") == ["runs/first", "runs/second/"]
    assert arguments.runs("nowhere/") == []
    assert arguments.files("") == ["plan.yaml", "runs/"]
    assert arguments.robots("p") == ["plan.yaml"]


@pytest.mark.long
def test_json_holds_the_tables_with_numbers_and_messages_go_elsewhere(
    hil: Hil, tmp_path: Path, manutec: Robot
) -> None:
    write_run(tmp_path / "run", manutec)
    status, printed, err = hil("identify", tmp_path / "run", "--json")
    found = json.loads(printed)
    assert found["command"] == "identify"
    assert found["judgement"]["word"] in {"good", "doubtful", "failed"}
    assert status == (3 if found["judgement"]["word"] == "failed" else 0)
    rows = [row for table in found["tables"] for row in table["rows"] if row.get("name") == "p5"]
    assert isinstance(rows[0]["value"], float)
    assert rows[0]["unit"] == "kg m"
    assert "model in" in err


@pytest.mark.parametrize(
    "line", ["robot manutec-r15", "doctor", "drives scan --nodes 1-2", "dry-run plan.yaml"]
)
def test_every_command_writes_json(
    line: str, hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    hil("plan", "manutec-r15", "--gravity", 4, "--inertia", 10, "--coupling", 1, "-o", "plan.yaml")
    found = json.loads(hil(*line.split(), "--json")[1])
    assert found.get("tables") or found.get("points")


def test_what_is_refused_writes_no_json(hil: Hil) -> None:
    status, printed, err = hil("robot", "puma", "--json")
    assert (status, printed) == (1, "")
    assert "unknown robot" in err


@pytest.mark.parametrize("words", [("-q", "plan"), ("plan", "-q")])
def test_quiet_leaves_messages_out(hil: Hil, tmp_path: Path, words: tuple[str, ...]) -> None:
    plan = tmp_path / "plan.yaml"
    arguments = ("manutec-r15", "--gravity", 4, "--inertia", 10, "--coupling", 1, "-o", plan)
    assert hil(*words, *arguments)[:2] == (0, "")
    assert "total" in hil("dry-run", plan, "-q")[1]
    assert out.messages is False
    plan.unlink()
    assert "measurements in" in hil("plan", *arguments)[1]


def test_verbose_shows_where_a_refusal_comes_from(
    hil: Hil, monkeypatch: pytest.MonkeyPatch
) -> None:
    from checked_files.errors import HilError
    from hil import cli

    for name, value in (("handlers", []), ("level", logging.root.level)):
        monkeypatch.setattr(logging.root, name, value)  # restore logging for other tests
    with pytest.raises(HilError, match="unknown robot"):
        cli.main(["robot", "puma", "-v"])
    assert logging.getLogger().level == logging.INFO
