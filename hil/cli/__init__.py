"""Command line: from a robot to a plan, a run, an identified model and a report.

Commands are thin: each one reads its files, calls one function of a module below and prints. Faults
of files, drives or the bus end in one message on standard error and a non-zero status, never in a
traceback. The module of a command is imported when the command is chosen, and numerics when the
command is called, so that help and completion load quickly.

Here are the common parts of commands: examples, ``--quiet``, ``--verbose``, ``--json``, exit
statuses.
"""

from __future__ import annotations

import logging
import sys
from functools import cache
from importlib import import_module
from itertools import pairwise
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option
from typer.core import TyperGroup

from checked_files.foreign_text import shown
from hil.terminal.console import out

if TYPE_CHECKING:
    from collections.abc import Sequence


_CAN = "--interface socketcan --channel can0"
EXAMPLES: dict[str, tuple[str, str]] = {
    "": (
        "hil plan manutec-r15 --minutes 10 -o plan.yaml && hil run plan.yaml -o runs/first",
        "hil identify runs/first && hil report runs/first",
    ),
    "try": ("hil try", "hil try --no-browser --live 8420 -o runs/demo"),
    "robot show": ("hil robot manutec-r15", "hil robot arm.yaml --json"),
    "robot new": (
        "hil robot new --urdf arm.urdf -o arm.yaml",
        "hil robot new --mdh arm.csv -o arm.yaml",
    ),
    "plan": (
        "hil plan manutec-r15 --minutes 10 -o plan.yaml",
        "hil plan arm.yaml --kind friction --axis 2 --workspace cell.yaml -o sweep.yaml",
    ),
    "dry-run": (
        "hil dry-run plan.yaml",
        "hil dry-run plan.yaml --noise-from runs/first --page plan.html",
    ),
    "view": ("hil view plan.yaml", "hil view runs/first --urdf arm.urdf -o first.html"),
    "twin": ("hil twin arm.yaml -o twin", "hil twin my-robot.yaml --output twins/my-robot"),
    "drives scan": (f"hil drives scan {_CAN}", "hil drives scan --nodes 1-6"),
    "drives check": (
        "hil drives check manutec-r15 --yes",
        f"hil drives check drives.yaml {_CAN} --axis 1 --angle 2",
    ),
    "drives jog": (
        "hil drives jog manutec-r15 3 --by -10",
        f"hil drives jog drives.yaml 'joint 3' --by 5 --speed 2 {_CAN}",
    ),
    "drives home": (
        "hil drives home manutec-r15 5 --method 37",
        f"hil drives home drives.yaml 1 {_CAN}",
    ),
    "drives monitor": (
        f"hil drives monitor drives.yaml {_CAN}",
        "hil drives monitor manutec-r15 --for 10",
    ),
    "drives new": (
        "hil drives new --eds drive.eds --nodes 1-6 -o drives.yaml",
        f"hil drives new {_CAN} -o drives.yaml",
    ),
    "drives example": ("hil drives example -o .", "hil drives example -o box"),
    "drives restore": (
        "hil drives restore runs/first/found-settings.yaml",
        f"hil drives restore runs/first/found-settings.yaml {_CAN} --other-bus",
    ),
    "drives reset-faults": (
        f"hil drives reset-faults drives.yaml {_CAN}",
        "hil drives reset-faults manutec-r15 --axis 2 --yes",
    ),
    "run": (
        "hil run plan.yaml -o runs/first --live",
        f"hil run plan.yaml -o runs/cell --drives drives.yaml {_CAN} --rehearse",
    ),
    "import": (
        "hil import --draft recording.csv --robot arm.urdf -o map.yaml",
        "hil import map.yaml -o runs/imported",
    ),
    "identify": (
        "hil identify runs/first --refine simulation",
        "hil identify runs/first --with runs/second --json",
    ),
    "validate": (
        "hil validate runs/other --model runs/first",
        "hil validate runs/first --truth manutec-r15",
    ),
    "report": ("hil report runs/first", "hil report runs/first --figures figures"),
    "friction": ("hil friction runs/sweep", "hil friction runs/sweep --model runs/first"),
    "payload two-runs": (
        "hil payload runs/first runs/loaded",
        "hil payload runs/first runs/loaded --mass 4.5",
    ),
    "payload measure": (
        "hil payload measure --model runs/first -o runs/load --at-most 5",
        f"hil payload measure --model runs/first -o runs/load --drives drives.yaml {_CAN}",
    ),
    "diagnose": ("hil diagnose runs/first", "hil diagnose runs/first --without g07"),
    "export": (
        "hil export runs/first --to c -o code",
        "hil export runs/first --to mjcf --patch arm.xml -o sim",
    ),
    "replay": (
        "hil replay runs/other --model runs/first --max-error 2deg --before arm.urdf",
        "hil replay runs/other --model runs/first --simulator mujoco --restart 0.5",
    ),
    "track": (
        "hil track fast.yaml --model runs/first -o runs/track",
        f"hil track fast.yaml --model runs/first -o runs/track --drives drives.yaml {_CAN}",
    ),
    "watch": (
        "hil watch shift.yaml --model runs/first -o runs/watch --hours 2",
        "hil watch shift.yaml --model runs/first -o runs/watch --stop --live",
    ),
    "accept": (
        "hil accept runs/good --draft -o limits.yaml",
        "hil accept runs/first --limits limits.yaml --serial 0042 -o accepted",
    ),
    "history": (
        "hil history runs/january runs/june",
        "hil history runs/january runs/june --page history.html --fail-on-change",
    ),
    "fleet identify": (
        "hil fleet identify plant-a plant-b",
        "hil fleet identify plant-a --scheduler tcp://host:8786",
    ),
    "fleet index": (
        "hil fleet index plant-a plant-b -o fleet.parquet",
        "hil fleet index s3://bucket/plant-a -o fleet.parquet --workers 4",
    ),
    "fleet query": ("hil fleet query fleet.parquet", "hil fleet query fleet.parquet --rate 0.1"),
    "fleet page": (
        "hil fleet page fleet.parquet -o fleet.html",
        "hil fleet page fleet.parquet -o fleet.html --rate 0.1",
    ),
    "doctor": ("hil doctor", "hil doctor --folder runs --json"),
}
"""Examples of the commands, shown below the help and parsed by a test."""
STATUSES = {
    0: "done",
    1: "not completed, or a check found a fault; see the message on standard error",
    2: "wrong usage: an unknown option, or options that do not go together",
    3: "completed, but failed (identify, validate, accept, export), with alarms (watch), beyond the"
    " limit (replay), or without some models (fleet index)",
    4: "completed, with significant changes (history --fail-on-change)",
    130: "stopped by Ctrl-C, a signal or the stop key; the axes are off",
}
"""Exit statuses of the commands."""
HELP = {
    "quiet": "Show results and warnings only.",
    "verbose": "Show log records and tracebacks; given twice, also those of the bus.",
    "json": "Write results as one JSON object; messages go to standard error.",
}
TYPES = {"path": "PATH", "str": "TEXT", "int": "NUMBER", "float": "NUMBER"}
"""Words of the help for types of values."""
COUNTED = {"count": True, "metavar": "", "show_default": False}
"""Settings of an option that counts occurrences."""


def set_output(*, quiet: bool = False, verbose: int = 0, json: bool = False) -> None:
    """Set the amount of output, or JSON; earlier settings persist."""
    if quiet:
        out.messages = False
    if json:
        # collect results for a JSON object; other output goes to standard error
        out.given, out.stderr = {"tables": []}, True
    if verbose:
        level = logging.INFO if verbose == 1 else logging.DEBUG
        logging.basicConfig(level=level, format="%(levelname)s %(name)s: %(message)s", force=True)
        out.verbose = True


def epilog(path: str, *, exit_statuses: bool = False) -> str:
    """Format the examples of a command or group for the end of the help."""
    lines = (f" \\\n{'':6}".join(_split(line, 74)) for line in examples_of(path))
    text = ["[bold]Examples[/bold]", *(f"  {line}".replace("[", "\\[") for line in lines)]
    if exit_statuses:
        text += ["", "[bold]Exit status[/bold]"]
        for status, meaning in STATUSES.items():
            text.append(f"{status:>5}  " + f"\n{'':7}".join(_split(meaning, 70)))
    return "\n".join(text)


def _split(text: str, width: int) -> list[str]:
    """Split a text between words, never at hyphens, into lines for a terminal."""
    return wrap(text, width, break_on_hyphens=False, break_long_words=False)


def examples_of(path: str) -> Sequence[str]:
    """Return two examples of a command; for a group, the first examples of two commands."""
    if path in EXAMPLES:
        return EXAMPLES[path]
    inner = [lines[0] for name, lines in EXAMPLES.items() if name.startswith(f"{path} ")]
    return inner[:2]


def equip(command: Any, path: str) -> Any:
    """Add examples and common options to a command, and to subcommands."""
    command.epilog = epilog(path)
    parameters = command.get_params
    command.get_params = lambda context: name_types(parameters(context), context)
    paragraphs = (command.help or "").split("\n\n")  # rich would keep the line ends
    command.help = "\n\n".join(" ".join(each.split()) for each in paragraphs)
    for name, member in getattr(command, "commands", {}).items():
        equip(member, f"{path} {name}")
    if hasattr(command, "commands"):
        return command
    command.params += _common_options()
    # make a command write the JSON results at the end, successful or not
    invoke = command.invoke

    def invoked(context: Any) -> Any:
        try:
            done = invoke(context)
        except (typer.Exit, SystemExit):
            _write_json(path)
            raise
        _write_json(path)
        return done

    command.invoke = invoked
    return command


def name_types(parameters: list[Any], context: Any) -> list[Any]:
    """Set short names for the values of options in the help, such as ``NUMBER``.

    Defaults in words become part of the help, since typer would add brackets. Flags take no value,
    although some versions of typer show one; arguments are named already.
    """
    for each in parameters:
        if isinstance(default := getattr(each, "show_default", False), str):
            each.help, each.show_default = rf"{each.help} [dim]\[default: {default}][/dim]", False
        if getattr(each, "is_flag", False):
            each.metavar = ""
        elif hasattr(each, "display_type"):
            shown = each.display_type(context).strip("<>").removeprefix("list[").rstrip("]")
            kind = TYPES.get(shown.removesuffix(" range").lower())
            if each.param_type_name == "argument":
                each.display_type_rich = lambda **_: None
            elif each.metavar is None and (kind or "|" in shown):
                each.metavar = kind or shown.replace("|", " | ")
    return parameters


def _own(name: str, *flags: str, **more: Any) -> Any:
    """Create a common option, handled by `set_output` and hidden from the command."""
    return Option(
        *flags, help=HELP[name], callback=lambda value: set_output(**{name: value}),
        expose_value=False, is_eager=True, rich_help_panel="Output", **more,
    )  # fmt: skip


@cache
def _common_options() -> list[Any]:
    """Create the common options, as typer builds them for an empty command."""
    made = typer.Typer(add_completion=False)

    @made.command()
    def _(
        quiet: Annotated[bool, _own("quiet", "-q", "--quiet")] = False,
        verbose: Annotated[int, _own("verbose", "-v", "--verbose", **COUNTED)] = 0,
        json: Annotated[bool, _own("json", "--json")] = False,
    ) -> None: ...

    return [each for each in typer.main.get_command(made).params if each.name != "help"]


def _write_json(path: str) -> None:
    if out.given is not None:
        import json

        found = {"command": path, **{key: value for key, value in out.given.items() if value}}
        text = json.dumps(found, indent=2, ensure_ascii=False)
        # escapes of JSON for control characters, which a terminal would obey
        if not text.replace("\n", "").isprintable():
            text = json.dumps(found, indent=2)
        sys.stdout.write(f"{text}\n")


PANELS = {
    "First steps": {
        "try": "Demonstrate hil on a virtual robot in two minutes: measure, identify, predict, "
               "push.",
    },
    "Plan": {
        "robot": "Show what can be identified of a robot, or write a first robot file.",
        "plan": "Plan measurements: strokes, friction sweeps, an exciting trajectory, or a load.",
        "dry-run": "Check a plan and predict its duration and precision; nothing moves.",
        "view": "Write a 3-D page of a plan, a run or a robot; one HTML file.",
        "twin": "Write a virtual plant of a robot and a drives file, for rehearsals.",
    },
    "Measure": {
        "drives": "Commission drives: scan, check, jog, home, monitor, write files, restore.",
        "run": "Measure a plan into a run folder; the robot moves.",
        "import": "Import recordings of any robot into a run folder.",
    },
    "Identify": {
        "identify": "Identify dynamics and friction from measured or imported runs.",
        "validate": "Validate a model on held-out data, or an estimate against a known truth.",
        "report": "Write the report of a run; one HTML file.",
        "friction": "Fit friction laws to a run and test the symmetry of friction.",
        "payload": "Identify a load from runs without and with it, or measure one in minutes.",
        "diagnose": "Test a robot file for missing effects and wrong values.",
    },
    "Use a model": {
        "export": "Export an identified model, or the recordings of a run, to other tools.",
        "replay": "Simulate the recordings of a run with a model, and compute the position error.",
        "track": "Measure the tracking error without and with feed-forward; the robot moves.",
        "watch": "Detect external forces while a plan moves the robot.",
    },
    "Series production and condition monitoring": {
        "accept": "Judge an identified run by limits; writes a page to sign and JUnit XML.",
        "history": "Show how parameters and friction of one machine change over many runs.",
        "fleet": "Index the models of many machines, and find machines that deviate from the "
                 "fleet.",
    },
    "This computer": {
        "doctor": "Check this computer: Python, CAN, rights, clock, disk.",
    },
}  # fmt: skip
"""Panels of the help, with commands in order of use and the first line of their help.

The help repeats the commands' own docstrings; a test compares them.
"""
MODULES = {
    "robot": "planning", "plan": "planning", "dry-run": "planning", "view": "viewing",
    "twin": "planning", "drives": "drives", "run": "measuring", "import": "exchanging",
    "identify": "results", "validate": "judging", "report": "results", "friction": "results",
    "payload": "payload", "diagnose": "results", "export": "exchanging", "track": "beside_model",
    "watch": "beside_model", "replay": "viewing", "accept": "judging", "history": "judging",
    "doctor": "doctor", "try": "trying", "fleet": "judging",
}  # fmt: skip
"""Module of a command, or group of commands, in this package."""
COMMANDS = {name: text for panel in PANELS.values() for name, text in panel.items()}


class _ImportedLate(TyperGroup):
    """Group with the texts of `COMMANDS`, importing only the chosen command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse an empty argument, which as a path would mean the current folder.

        An argument with a line break is refused too, since it would forge a line of a message.
        """
        for before, word in pairwise(["hil", *args]):
            if not word or (word.startswith("--") and word.endswith("=")):
                raise typer.BadParameter(
                    f"{(word or before)!r} has no value; add one (is a shell variable empty?)"
                )
            if len(word.splitlines()) > 1:
                raise typer.BadParameter(f"{word!r} has a line break; rename the file or folder")
        parsed: list[str] = super().parse_args(ctx, args)
        return parsed

    def get_params(self, ctx: Any) -> list[Any]:
        return name_types(super().get_params(ctx), ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Return name, command and arguments, in the classes of typer's own copy of click."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, import_command(name) if name in COMMANDS else command, rest


def import_command(name: str) -> Any:
    """Import a command or a group of commands by name, with the common options."""
    module = import_module(f"{__name__}.{MODULES[name]}")
    return equip(typer.main.get_group(module.commands).commands[name], name)


def _show_version(wanted: bool) -> None:
    if wanted:
        from hil.version import __version__

        typer.echo(f"hil {__version__}")
        raise typer.Exit


app = typer.Typer(
    cls=_ImportedLate,
    help="Identify a robot's dynamics and friction on the machine itself, over its fieldbus.",
    epilog=epilog("", exit_statuses=True),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _panel, _commands in PANELS.items():
    for _name, _text in _commands.items():
        app.command(_name, help=_text, rich_help_panel=_panel)(lambda: None)


@app.callback()
def _program(
    _version: Annotated[
        bool,
        Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
    quiet: Annotated[bool, Option("-q", "--quiet", help=HELP["quiet"])] = False,
    verbose: Annotated[int, Option("-v", "--verbose", help=HELP["verbose"], **COUNTED)] = 0,
) -> None:
    set_output(quiet=quiet, verbose=verbose)


def main(
    arguments: Sequence[str] | None = None, program: typer.Typer = app, name: str = "hil"
) -> None:
    """Run `hil` or `program`; exit status 1 after a message, 2 for wrong usage."""
    out.begin()
    if logging.lastResort is not None:
        # notes of an error are shown below the error's message
        logging.lastResort.addFilter(lambda record: not getattr(record, "noted", False))
    try:
        program(None if arguments is None else list(arguments), prog_name=name)
    except OSError as error:
        message = f"{error.filename or name}: {error.strerror or error}"
        sys.stderr.write(f"{shown(message)}\n")
        sys.exit(1)
    except Exception as error:
        from checked_files.errors import HilError  # its message is sufficient for the operator

        if not isinstance(error, HilError) or out.verbose:
            raise
        sys.stderr.write(f"{shown(error.lines)}\n")
        sys.exit(1)
