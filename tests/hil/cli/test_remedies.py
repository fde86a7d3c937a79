"""Commands offered as remedies by messages exist, with their options."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from every_command import every_command

import hil

EVERY = every_command()
COMMAND = re.compile(r"\bhil ((?:[a-z]+ ?)+)([^;,()`'\"]*)")
"""Command with its arguments up to the end of the clause."""


def texts(path: Path) -> list[str]:
    """Return messages of a module: its strings without values of f-strings and docstrings."""
    tree = ast.parse(path.read_text())
    documented = {
        id(first.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        for first in node.body[:1]
        if isinstance(first, ast.Expr)
    }
    found: list[str] = []
    inner: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            inner |= {id(part) for part in node.values}
            parts = (p.value if isinstance(p, ast.Constant) else "X" for p in node.values)
            found.append("".join(map(str, parts)))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and id(node) not in inner | documented:
            found += [node.value] if isinstance(node.value, str) else []
    return found


def unknown(text: str) -> list[str]:
    """Return commands and options in a text that do not exist."""
    wrong = []
    for words, rest in COMMAND.findall(text):
        names = words.split()
        name = next((n for k in (2, 1) if (n := " ".join(names[:k])) in EVERY), None)
        if name is None:
            continue  # "hil" in a sentence, not a command
        known = {o for parameter in EVERY[name].params for o in parameter.opts}
        nested = [c for n, c in EVERY.items() if n.startswith(f"{name} ")]
        known |= {o for each in nested for parameter in each.params for o in parameter.opts}
        wrong += [f"hil {name} {o}" for o in re.findall(r"--[a-z-]+", rest) if o not in known]
    return wrong


def test_every_option_that_a_message_offers_exists() -> None:
    root = Path(hil.__file__).parent
    found = {
        (path.name, each)
        for path in sorted(root.rglob("*.py"))
        for text in texts(path)
        for each in unknown(text)
    }
    assert found == set()


def test_an_option_that_there_is_not_is_found() -> None:
    assert unknown("measure it again with: hil run X --resumed") == ["hil run --resumed"]
