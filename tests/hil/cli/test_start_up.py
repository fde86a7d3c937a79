"""Modules loaded by help and completion, and agreement of all help texts with their modules."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING

import pytest
import typer
from every_command import every_command

from hil.cli import COMMANDS, MODULES, PANELS

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil

HEAVY = {"numpy", "scipy", "numba", "h5py", "canopen", "can", "matplotlib"}
"""Slow modules; pydantic is excluded, since typer loads it for the options."""


PROGRAM = """
import atexit, sys
from hil.__main__ import main
atexit.register(lambda: sys.stderr.write("loaded " + " ".join(sys.modules)))
main()
"""
ALL_HELP = """
import sys
from hil.cli import main
for line in sys.argv[1:]:
    try:
        main([*line.split(), "--help"])
    except SystemExit as left:
        assert not left.code
    sys.stderr.write(f"{line}: {' '.join(sys.modules)}\\n")
"""


def program(*arguments: str, **variables: str) -> tuple[str, set[str]]:
    """Call `hil` in a separate process; return its output, and the loaded modules."""
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", PROGRAM, *arguments],
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout, set(done.stderr.rpartition("loaded ")[2].split())


def completed(words: str) -> tuple[list[str], set[str]]:
    """Complete the last word of a command line like bash."""
    position = str(len(words.split(" ")) - 1)
    printed, loaded = program(_HIL_COMPLETE="complete_bash", COMP_WORDS=words, COMP_CWORD=position)
    return printed.split(), loaded


EVERY = every_command()


def test_the_help_loads_neither_numerics_nor_a_bus() -> None:
    printed, loaded = program("--help")
    assert "identify" in printed
    assert not loaded & {*HEAVY, "pydantic"}


def test_a_report_of_what_is_kept_loads_no_estimator() -> None:
    asked = "import sys, hil.report.page; print(*sys.modules)"
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert "hil.results.findings" in loaded
    assert not loaded & {"hil.results.identification", "hil.results.load", "scipy.optimize"}


def test_an_identification_loads_no_optimiser_before_it_is_needed() -> None:
    asked = (
        "import sys, hil.results.identification; from hil.cli.results import options_of;"
        " options_of(None, None, None); print(*sys.modules)"
    )
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert "hil.estimation.signals" in loaded
    assert not loaded & {"scipy.optimize", "scipy.linalg", "hil.export"}


def test_a_command_s_name_completes_without_any_command_s_module() -> None:
    words, loaded = completed("hil ide")
    assert words == ["identify"]
    assert not loaded & HEAVY
    assert not loaded & {f"hil.cli.{module}" for module in MODULES.values()}


def test_options_complete_with_the_module_of_their_command_alone() -> None:
    words, loaded = completed("hil identify --")
    assert {"--method", "--with"} <= set(words)
    assert not loaded & HEAVY
    assert loaded & {f"hil.cli.{module}" for module in MODULES.values()} == {"hil.cli.results"}


def test_the_shell_completes_values() -> None:
    assert "manutec-r15" in completed("hil robot show man")[0]
    assert completed("hil export runs --to mc")[0] == ["mcap"]
    assert completed("hil identify --method ins")[0] == ["instrumental\\", "variables"]


def test_the_shell_is_given_a_script_that_asks_hil() -> None:
    printed, _ = program(_HIL_COMPLETE="source_bash")
    assert "_HIL_COMPLETE=complete_bash" in printed


def test_no_command_s_help_loads_numerics_or_a_bus() -> None:
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", ALL_HELP, *EVERY], capture_output=True, text=True, check=True
    )
    lines = done.stderr.splitlines()
    assert len(lines) == len(EVERY)
    for line in lines:
        name, _, loaded = line.partition(": ")
        assert not set(loaded.split()) & HEAVY, name


def test_planning_needs_no_scipy_and_a_dry_run_no_bus(tmp_path: Path) -> None:
    few = ("--gravity", "12", "--inertia", "12", "--coupling", "3")
    plan = str(tmp_path / "plan.yaml")
    _, loaded = program("plan", "manutec-r15", *few, "-o", plan)
    assert "scipy" not in loaded
    _, loaded = program("dry-run", plan)
    assert not loaded & {"can", "canopen", "h5py"}


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_repeats_their_own_help(name: str) -> None:
    command = EVERY[name]
    assert COMMANDS[name] == inspect.cleandoc(command.help).splitlines()[0]


def test_every_command_of_a_module_is_listed() -> None:
    for module in set(MODULES.values()):
        stated = {name for name, own in MODULES.items() if own == module}
        offered = typer.main.get_group(import_module(f"hil.cli.{module}").commands).commands
        assert set(offered) == stated


def test_the_help_shows_the_commands_panel_by_panel() -> None:
    printed, _ = program("--help")
    shown = re.findall(r"^(?:╭─ |│ )([A-Z][\w ]+|[a-z-]+) (?:─| )", printed, re.MULTILINE)
    wanted = [line for panel, commands in PANELS.items() for line in (panel, *commands)]
    assert [line for line in shown if line in wanted] == wanted


@pytest.mark.parametrize("name", EVERY)
def test_each_option_is_explained_in_one_sentence(name: str) -> None:
    for parameter in EVERY[name].params:
        text = parameter.help
        assert re.fullmatch(r"[A-Z][^.]*(?:\.\w[^.]*)*\.", text), f"{parameter.name}: {text}"
        assert not re.match(r"(Of|Its|Their|How|bit/s)\b", text), f"{parameter.name}: {text}"


@pytest.mark.parametrize("name", EVERY)
def test_the_help_shows_every_word_and_every_unit_in_brackets(
    name: str, hil: Hil, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rich would remove [s] and similar units unless they are marked as text."""
    monkeypatch.setattr("typer.rich_utils.MAX_WIDTH", 600)
    status, shown, _ = hil(*name.split(), "--help")
    assert status == 0
    texts = [parameter.help for parameter in EVERY[name].params] + EVERY[name].help.split("\n\n")
    for text in texts:
        assert " ".join(text.replace("\\[", "[").split()) in shown


def test_units_in_brackets_are_found() -> None:
    """Verify that the test above finds units at all."""
    stated = [parameter.help for command in EVERY.values() for parameter in command.params]
    assert sum("\\[" in text for text in stated) > 20


def test_the_version_is_that_of_the_package() -> None:
    printed, loaded = program("--version")
    assert printed.split() == ["hil", version("canopen-robot-identification")]
    assert not loaded & HEAVY


def test_h_is_help() -> None:
    assert "--method" in program("identify", "-h")[0]
