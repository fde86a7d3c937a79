"""A command checks its outputs before it reads or computes anything.

The commands and their options are found by asking the program, so that none is left out.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from every_command import every_command
from small_run import write_run

from hil.cli import outputs
from hil.planning.plan import dump_plan

if TYPE_CHECKING:
    from command_line import Hil

    from hil.model.robot import Robot
    from hil.planning.plan import Plan

CALLBACKS = {
    callback.__name__
    for callback in (
        outputs.new_file, outputs.file_to_write, outputs.folder_to_write, outputs.place_to_write,
        outputs.new_folder,
    )
}  # fmt: skip
WRITTEN = re.compile(
    r"\b(to write|to write into|to make|written to|logged to|of the (run|measurement|three runs)"
    r"|of page)\b"
)
READ = {"--drives", "--model", "--noise-from", "--refine", "--symmetric", "--workspace"}
"""Options that name a file or a run to be read, independent of their help."""
FILES = {new for new in CALLBACKS if "file" in new}
EVERY = every_command()


def options(command: Any) -> list[Any]:
    return [each for each in command.params if each.param_type_name == "option"]


def callback_of(option: Any) -> str:
    """Return the name of our callback inside typer's wrapper; empty without a callback."""
    wrapped = getattr(option.callback, "__wrapped__", option.callback)
    return str(getattr(wrapped, "__name__", ""))


def writing() -> list[Any]:
    """Return command, option and callback of all outputs with a path from the user."""
    return [
        pytest.param(name, option.opts[0], callback_of(option), id=f"{name} {option.opts[-1]}")
        for name, command in EVERY.items()
        for option in options(command)
        if callback_of(option) in CALLBACKS
    ]


def arguments(name: str) -> list[str]:
    """Return the other arguments of a command: names of missing files."""
    required = [each for each in EVERY[name].params if each.required]
    named = [each for each in required if each.param_type_name == "option"]
    given = [part for each in named if "-o" not in each.opts for part in (each.opts[0], "nowhere")]
    return [*given, *["nowhere" for each in required if each.param_type_name != "option"]]


def plain(text: str) -> str:
    """Return text without frames and line breaks of the terminal."""
    return " ".join(re.sub(r"[│╭╮╰╯─]", " ", text).split())


@pytest.mark.parametrize("name", [name for name in EVERY if not hasattr(EVERY[name], "commands")])
def test_every_option_that_is_written_to_is_looked_at_first(name: str) -> None:
    for option in options(EVERY[name]):
        shown = WRITTEN.search(option.help) and not READ & set(option.opts)
        if "-o" in option.opts or shown:
            assert callback_of(option) in CALLBACKS, option.opts


def test_the_options_are_found() -> None:
    found = {each.id for each in writing()}
    assert len([each for each in found if each.endswith("--output")]) >= 12
    assert found >= {"history --page", "report --figures", "run --frame-log"}


@pytest.mark.parametrize(("name", "option", "callback"), writing())
def test_nothing_is_read_for_what_cannot_be_written(
    hil: Hil, tmp_path: Path, name: str, option: str, callback: str
) -> None:
    """The input files are missing, and the command does not notice."""
    file = tmp_path / "file"
    file.write_text("something of the user's")
    chosen = [] if option == "-o" or "-o" not in required(name) else ["-o", tmp_path / "good"]
    status, _, err = hil(*name.split(), *chosen, option, file / "below", *arguments(name))
    refusal = r"there is no folder" if callback in FILES else r"is not a folder|there is no folder"
    assert (status, bool(re.search(refusal, err))) == (1, True), err
    assert "nowhere" not in err
    assert file.read_text() == "something of the user's"


def required(name: str) -> set[str]:
    return {opt for each in EVERY[name].params if each.required for opt in each.opts}


@pytest.mark.parametrize(
    ("name", "option", "callback"), [each for each in writing() if "new" in each.values[2]]
)
def test_nothing_is_read_where_something_is_there_already(
    hil: Hil, tmp_path: Path, name: str, option: str, callback: str
) -> None:
    file = tmp_path / "file"
    file.write_text("something of the user's")
    status, _, err = hil(*name.split(), option, file, *arguments(name))
    assert (status, "already exists" in err) == (1, True), err
    assert file.read_text() == "something of the user's"


def test_a_folder_is_made_with_those_about_it_and_a_file_s_folder_is_not(
    hil: Hil, tmp_path: Path
) -> None:
    output = tmp_path / "no" / "plan.yaml"
    assert hil("plan", "manutec-r15", "-o", output)[0] == 1
    assert not output.parent.exists()
    _, _, err = hil("run", "nowhere", "-o", tmp_path / "runs" / "of" / "mine")
    assert "nowhere" in err
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("command", "result"),
    [
        ("identify", "model.yaml"), ("report", "report.html"), ("diagnose", "diagnosis.yaml"),
        ("friction", "friction.yaml"), ("payload", "load.yaml"), ("view", "view.html"),
        ("validate", "validation.yaml"),
    ],
)  # fmt: skip
def test_a_result_that_could_not_be_kept_is_not_computed(
    hil: Hil, tmp_path: Path, command: str, result: str
) -> None:
    (tmp_path / "run" / result).mkdir(parents=True)
    more = {"payload": [tmp_path / "nowhere"], "validate": ["--model", tmp_path / "nowhere"]}
    run = tmp_path / "run"
    given = [*more["payload"], run] if command == "payload" else [run, *more.get(command, [])]
    status, _, err = hil(*command.split(), *given)
    assert (status, "is a folder, not a file" in err) == (1, True), err


def test_a_folder_that_takes_no_files_is_named(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The user of this test may have the right to write anywhere, so the system's refusal is
    simulated.
    """
    monkeypatch.setattr("os.access", lambda path, _mode: Path(path) != tmp_path)
    for arguments_ in (("plan", "manutec-r15", "-o", "plan.yaml"), ("run", "plan.yaml", "-o", "r")):
        *before, name = arguments_
        status, _, err = hil(*before, tmp_path / name)
        assert (status, "is not writable for this user" in err) == (1, True), err


def test_a_taken_run_folder_is_refused_before_the_plan_is_gone_through(
    hil: Hil, tmp_path: Path, manutec: Robot, small_plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_run(tmp_path / "run", manutec)
    plan = tmp_path / "plan.yaml"
    plan.write_text(dump_plan(small_plan))
    # patched before other modules import it
    monkeypatch.setattr("hil.tasks.measuring.checked", None)
    monkeypatch.setattr("hil.planning.dry_run.dry_run", None)
    status, _, err = hil("run", plan, "-o", tmp_path / "run")
    assert (status, "already exists; continue with --resume" in err) == (1, True), err
    status, _, err = hil("run", plan, "-o", tmp_path / "other", "--resume")
    assert (status, "is not a run folder" in err) == (1, True), err


def test_names_are_looked_at_before_anything_is_estimated(
    hil: Hil, tmp_path: Path, manutec: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = write_run(tmp_path / "run", manutec).path
    # patched before other modules import it
    monkeypatch.setattr("hil.results.problem.identified", None)
    monkeypatch.setattr("hil.results.identification.identified", None)
    for wrong, message in (
        (("--method", "improvd"), "did you mean improved"),
        (("--without", "g999"), "no measurement of the plan has this id"),
        (("--mass", "9:1:2"), "bounds of link 9: manutec-r15 has links 1 to 6"),
        (("--mass", "2:1"), "must be LINK:MIN:MAX"),
        (("--with", tmp_path / "other"), "is not a run folder"),
    ):
        status, _, err = hil("identify", run, *wrong)
        assert status in {1, 2}
        assert message in plain(err)
    status, _, err = hil("export", tmp_path / "nowhere", "--to", "jsn", "-o", tmp_path / "out")
    assert (status, "jsn: unknown format; did you mean json" in err) == (1, True), err
