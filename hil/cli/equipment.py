"""Common parts of commands: examples, ``--quiet``, ``--verbose``, ``--json``, exit statuses."""

from __future__ import annotations

import sys
from functools import cache
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hil.cli.examples import EXAMPLES
from hil.terminal.console import out

if TYPE_CHECKING:
    from collections.abc import Sequence

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


def set_output(*, quiet: bool = False, verbose: int = 0, json: bool = False) -> None:
    """Set the amount of output, or JSON; earlier settings persist."""
    if quiet:
        out.messages = False
    if json:
        out.begin_json()
    if verbose:
        import logging

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
    _write_json_after(command, path)
    return command


TYPES = {"path": "PATH", "str": "TEXT", "int": "NUMBER", "float": "NUMBER"}
"""Words of the help for types of values."""


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


COUNTED = {"count": True, "metavar": "", "show_default": False}
"""Settings of an option that counts occurrences."""


def _own(name: str, *flags: str, **more: Any) -> Any:
    """Create a common option, handled by `set_output` and hidden from the command."""
    return typer.Option(
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


def _write_json_after(command: Any, path: str) -> None:
    """Make a command write the JSON results at the end, successful or not."""
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


def _write_json(path: str) -> None:
    if out.given is not None:
        import json

        found = {"command": path, **{key: value for key, value in out.given.items() if value}}
        text = json.dumps(found, indent=2, ensure_ascii=False)
        # escapes of JSON for control characters, which a terminal would obey
        if not text.replace("\n", "").isprintable():
            text = json.dumps(found, indent=2)
        sys.stdout.write(f"{text}\n")
