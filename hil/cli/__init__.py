"""The command line: from a robot to a plan, a run, an identified model and a report.

Commands are thin: each one reads its files, calls one function of a module below and prints. What
is wrong with files, drives or the bus ends in one message on standard error and a non-zero status,
never in a traceback. The modules of commands are imported when one of theirs is chosen, and what
they work with when it is called, so that help and completion load no numerics.
"""

from __future__ import annotations

import sys
from importlib import import_module
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from hil.terminal.console import printable

if TYPE_CHECKING:
    from collections.abc import Sequence


PANELS = {
    "First of all": {
        "try": "Try it all on a virtual robot in five minutes: measure, identify, predict, push.",
    },
    "Robot and plan": {
        "robot": "Show base parameters, their groups, and where they occur in M and g.",
        "plan": "Choose configurations and motions from g(q) and M(q).",
        "dry-run": "State what a plan takes and what it gives; nothing moves.",
        "view": "Write a page that plays a plan or a run in 3-D, or shows a robot; one HTML file.",
    },
    "Run": {
        "run": "Measure a plan into a folder; the robot moves.",
        "track": (
            "Follow trajectories with neither, velocity and both fed forward; the robot moves."
        ),
        "watch": "Compare torques with a model's while a plan moves the robot, and find pushes.",
        "import": (
            "Turn recordings of any robot into a run folder; a map states which column is what."
        ),
    },
    "Results": {
        "identify": (
            "Estimate base parameters from runs of any kind; exit status 3 where that failed."
        ),
        "validate": (
            "Judge a model by a run that it was not made from; exit status 3 where it failed."
        ),
        "report": "Write a run's report, one HTML file.",
        "diagnose": (
            "Test what the robot file leaves out and what it states; writes diagnosis.yaml."
        ),
        "payload": "Find a load from two runs, without and with it, or measure one in minutes.",
        "accept": "Judge an identified run by limits; writes a page and JUnit XML, exit status 3 if"
        " failed.",
        "history": (
            "Show parameters and friction of one machine over many runs, and mark what changed."
        ),
        "export": "Write an identified model, or the recordings of a run, as files of other tools.",
    },
    "Drives and commissioning": {
        "doctor": "Examine this computer: Python, CAN, rights, clock, disk; exit status 1 where one"
        " fails.",
        "scan": "Find the nodes on a bus and what they lack for measuring; only reads.",
        "drives": "Write drives files, put found settings back, reset faults.",
        "check": "Check every drive against the drives file, at last by a small move of each axis.",
        "jog": "Move one axis by a small relative way, slowly; no other axis is powered.",
        "home": (
            "Let one drive find its reference by its own homing mode; no other axis is powered."
        ),
        "monitor": "Show states, positions, torques and emergencies live; sends nothing unless"
        " asked to.",
    },
    "Research": {
        "compare": "Set an estimate against the truth of the virtual plant.",
        "friction": "Friction, and how it changes in time.",
        "trajectory": "Conventional identification with periodic trajectories.",
    },
}  # fmt: skip
"""Panels of the help, the commands of each as a user meets them, and the first line of their help.

The help repeats the commands' own docstrings; a test compares them.
"""
MODULES = {
    "robot": "robots", "plan": "planning", "dry-run": "planning", "view": "viewing",
    "run": "measuring", "track": "beside_model", "watch": "beside_model", "import": "exchanging",
    "identify": "results", "validate": "judging", "report": "results", "diagnose": "results",
    "payload": "payload", "accept": "judging", "history": "judging", "export": "exchanging",
    "doctor": "doctor", "scan": "drives", "drives": "drives", "check": "commissioning",
    "jog": "commissioning", "home": "commissioning", "monitor": "monitoring", "compare": "results",
    "friction": "friction", "trajectory": "trajectory", "try": "trying",
}  # fmt: skip
"""Module of each command, or group of them, in this package."""
COMMANDS = {name: text for panel in PANELS.values() for name, text in panel.items()}


class _ImportedLate(TyperGroup):
    """Shows its commands as `COMMANDS` states them, and imports the one that is chosen."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse an empty argument, which as a path would be the current folder."""
        for before, word in pairwise(["hil", *args]):
            if not word or (word.startswith("--") and word.endswith("=")):
                raise typer.BadParameter(
                    f"{(word or before)!r} is followed by nothing; give a value (is a variable of"
                    " the shell empty?)"
                )
        parsed: list[str] = super().parse_args(ctx, args)
        return parsed

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Return name, command and arguments, in the classes of typer's own copy of click."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, imported(name) if name in COMMANDS else command, rest


def imported(name: str) -> Any:
    """Import a command, or a group of them, by its name."""
    module = import_module(f"{__name__}.{MODULES[name]}")
    return typer.main.get_group(module.commands).commands[name]


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"hil {version('canopen-robot-identification')}")
        raise typer.Exit


app = typer.Typer(
    cls=_ImportedLate,
    help="Identify a robot's dynamics on the machine itself, over CANopen.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _panel, _commands in PANELS.items():
    for _name, _text in _commands.items():
        app.command(_name, help=_text, rich_help_panel=_panel)(lambda: None)


@app.callback()
def _program(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="State the version."),
    ] = False,
) -> None:
    """Take the options that stand before a command."""


def main(
    arguments: Sequence[str] | None = None, program: typer.Typer = app, name: str = "hil"
) -> None:
    """Entry point of `hil` or of `program`; exit status 1 after a message, 2 for wrong usage."""
    try:
        program(None if arguments is None else list(arguments), prog_name=name)
    except OSError as error:
        message = f"{error.filename or name}: {error.strerror or error}"
        sys.stderr.write(f"{printable(message)}\n")
        sys.exit(1)
    except Exception as error:
        if not _explained(error):
            raise
        sys.stderr.write(f"{printable(str(error))}\n")
        sys.exit(1)


def _explained(error: Exception) -> bool:
    """Whether an error's own message is all that the operator needs."""
    from checked_files.errors import HilError

    return isinstance(error, HilError)
