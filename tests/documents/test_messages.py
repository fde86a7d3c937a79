"""Messages quoted in the page of messages exist in the program."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "messages.md"
QUOTED = re.compile(r"`([^`]+)`")


@cache
def said() -> str:
    """Return all source text with adjacent string literals joined."""
    every = (
        path
        for place in ("checked_files", "hil", "drivers")
        for path in (ROOT / place).rglob("*.py")
    )
    text = "\n".join(path.read_text(encoding="utf-8") for path in every)
    return re.sub(r'"\s*\n\s*f?"', "", text)


def quotes() -> list[str]:
    rows = PAGE.read_text(encoding="utf-8").split("the message has")[1:]
    cells = [line.split("|")[1] for part in rows for line in part.split("\n\n")[0].splitlines()[2:]]
    return [
        quote for cell in cells for quote in QUOTED.findall(cell) if not quote.startswith("hil ")
    ]


@pytest.mark.parametrize("quote", quotes())
def test_what_it_quotes_is_said(quote: str) -> None:
    assert quote in said()


def test_there_are_some_of_each_table() -> None:
    assert len(quotes()) > 12
