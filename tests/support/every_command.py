"""All commands of the program, listed by the program itself."""

from collections.abc import Iterator
from typing import Any

from hil.cli import COMMANDS, import_command


def every_command() -> dict[str, Any]:
    """Return all commands and groups of commands by name."""
    return {
        name: command
        for first in COMMANDS
        for name, command in _inner_commands(first, import_command(first))
    }


def _inner_commands(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    yield name, command
    for inner, member in getattr(command, "commands", {}).items():
        yield from _inner_commands(f"{name} {inner}", member)
