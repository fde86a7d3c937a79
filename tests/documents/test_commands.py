"""Commands in the documents exist, with all their options."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from hil import cli

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SHELL = re.compile(r"(?ms)^```(?:sh|bash|console)?\n(.*?)^```")
COMMAND = re.compile(r"(?m)^(?:\$ )?hil (.+)$")
DEMO = ROOT / "examples" / "demo.sh"
STEP = re.compile(r"(?m)^step (.+)$")
"""Steps of `make demo`, line by line."""


def commands() -> list[tuple[str, str]]:
    steps = STEP.findall(DEMO.read_text(encoding="utf-8"))
    assert len(steps) > 1
    return [(DEMO.name, line) for line in steps] + [
        (document.name, line)
        for document in DOCUMENTS
        for block in SHELL.findall(document.read_text(encoding="utf-8"))
        for line in COMMAND.findall(block)
    ]


def options_of(words: list[str]) -> set[str]:
    """Return the options of a command; for a group, those of
    the subcommand or of all subcommands.
    """
    command = cli.import_command(words[0])
    subcommands = getattr(command, "commands", {})
    chosen = [subcommands[word] for word in words[1:2] if word in subcommands]
    known = [command, *(chosen or subcommands.values())]
    parameters = [each for one in known for each in one.params]
    return {name for each in parameters for name in (*each.opts, *each.secondary_opts)}


@pytest.mark.parametrize(("document", "line"), commands())
def test_a_command_exists_and_has_its_options(document: str, line: str) -> None:
    name, *words = shlex.split(line, comments=True)
    if name.startswith("-"):
        assert name in {"--install-completion", "--version", "--help"}
        return
    named = {word for word in words if re.match(r"--?[a-z]", word)}
    assert named - options_of([name, *words]) - {"--help"} == set()
