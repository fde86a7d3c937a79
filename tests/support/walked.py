"""Execution of the code blocks of documents, and comparison with the printed output.

In order, in one folder: files of the page ("Write `axis.yaml`", "Save as `move.py`") are written,
commands executed, questions answered with y, and the printed lines of the page are searched in the
output of the command. `hil` is called in this process; everything else by a shell.
"""

from __future__ import annotations

import io
import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from hil.terminal.console import out as console

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pytest
    from command_line import Hil

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"(?ms)^```(\w*)\n(.*?)^```$")
NAMED = re.compile(r"(?:Write|Save as) `([\w.]+)`")
PROGRAMS = ("hil", "python", "ip", "sed", "pip", "pipx", "export")
"""First words of commands; a block without a language and without such a word is an output."""
NARROW, WIDE = 80, 200
"""Widths of the terminals for the printed tables."""


@dataclass
class Step:
    """Command of a page, with the printed part of its output."""

    command: str
    shown: list[str] = field(default_factory=list)


@dataclass
class File:
    """File written by the reader of a page."""

    name: str
    content: str


def steps(document: str) -> list[Step | File]:
    """Return the commands and files of a document, in order."""
    text = (ROOT / document).read_text(encoding="utf-8")
    found: list[Step | File] = []
    for block in BLOCK.finditer(text):
        language, content = block.groups()
        paragraph = text[: block.start()].rstrip().rpartition("\n\n")[2]
        if language:
            if named := NAMED.search(paragraph):
                found.append(File(named[1], content))
            continue
        lines = content.splitlines()
        if found and isinstance(found[-1], Step) and found[-1].shown:
            found[-1].shown.append("...")  # the output in another block may come later
        prompted = any(line.startswith("$ ") for line in lines)
        for line in lines:
            if line.startswith("$ ") if prompted else lines[0].split()[0] in PROGRAMS:
                found.append(Step(line.removeprefix("$ ")))
            else:
                last = found[-1]
                assert isinstance(last, Step), f"{document} shows {line!r} of no command"
                last.shown.append(line)
    return found


def environment() -> dict[str, str]:
    """Return an environment with the `hil` and `python` of the tests."""
    return {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


def lacking(shown: list[str], printed: str) -> list[str]:
    """Return the first successive lines of a page that are missing in the output of the command.

    Spaces, empty lines and the length of rules do not count; `...` stands for any lines, and within
    a line for any text.
    """
    lines = [_plain(line) for line in printed.splitlines() if line.strip()]
    pieces: list[list[str]] = [[]]
    for line in filter(str.strip, shown):
        if line.strip() in {"...", "…"}:
            pieces.append([])
        else:
            pieces[-1].append(_plain(line))
    there = 0
    for piece in pieces:
        patterns = [
            re.compile(".*".join(map(re.escape, re.split(r"\.\.\.|…", line)))) for line in piece
        ]
        for place in range(there, len(lines) - len(piece) + 1):
            if all(map(re.Pattern.fullmatch, patterns, lines[place:])):
                there = place + len(piece)
                break
        else:
            return piece
    return []


def _plain(line: str) -> str:
    return re.sub("─+", "─", " ".join(line.split()))


class Walk:
    """Execution of a document in the present folder.

    `instead` maps texts in commands to replacements (an emptied command is skipped), and `ends`
    commands to exit statuses other than 0; unused keys are refused. A repeated command is not
    executed again.
    """

    def __init__(self, hil: Hil, monkeypatch: pytest.MonkeyPatch) -> None:
        self._hil = hil
        self._monkeypatch = monkeypatch
        self._printed: dict[str, tuple[int, str]] = {}

    def __call__(
        self,
        document: str,
        instead: Mapping[str, str] | None = None,
        ends: Mapping[str, int] | None = None,
    ) -> dict[str, str]:
        """Return the output of each command."""
        printed: dict[str, str] = {}
        instead, ends = instead or {}, ends or {}
        unused = {*instead, *ends}
        for step in steps(document):
            if isinstance(step, File):
                Path(step.name).write_text(step.content, encoding="utf-8")
                continue
            command = step.command
            for text, replacement in instead.items():
                if text in command:
                    unused.discard(text)
                    command = command.replace(text, replacement)
            unused.discard(step.command)
            if not shlex.split(command, comments=True):
                continue
            if command not in self._printed:
                self._printed[command] = self._carry_out(command, step.shown)
            status, text = self._printed[command]
            assert status == ends.get(step.command, 0), f"{document}: {command}\n{text}"
            assert lacking(step.shown, text) == [], f"{document}: {command}\n{text}"
            printed[step.command] = text
        assert not unused, f"{document} has no such command"
        return printed

    def _carry_out(self, command: str, shown: list[str]) -> tuple[int, str]:
        name, *words = shlex.split(command, comments=True)
        if name == "hil":
            rules = [len(line) for line in shown if "──" in line]
            width = NARROW if rules and max(rules) <= NARROW else WIDE
            self._monkeypatch.setattr(console, "width", width)
            self._monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
            status, out, err = self._hil(*words)
            return status, out + err
        done = subprocess.run(  # noqa: S603 - as our own page prints it
            ["bash", "-c", command],  # noqa: S607 - wherever bash is
            env=environment(),
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        )  # fmt: skip
        return done.returncode, done.stdout
