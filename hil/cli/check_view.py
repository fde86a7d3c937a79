"""What a check of drives found, line by line as it comes, and how many lines of each grade."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console

STYLES = {"ok": "green", "warning": "yellow", "refused": "bold red"}
INDENT = " " * 9


class Line(NamedTuple):
    """What one check came to, in words; `grade` is a key of `STYLES`."""

    grade: str
    place: str
    check: str
    found: str
    bound: str
    remedy: str


def show(lines: Iterable[Line], console: Console) -> bool:
    """Print lines as they come, by axis; return whether none is refused."""
    counts: Counter[str] = Counter()
    place = ""
    for line in lines:
        if line.place != place:
            place = line.place
            console.print(f"\n{place}", style="bold", highlight=False, markup=False)
        counts[line.grade] += 1
        console.print(_text(line), soft_wrap=True, highlight=False)
    total = ", ".join(f"{counts[grade]} {grade}" for grade in STYLES)
    console.print(f"\n{total}", highlight=False)
    return not counts["refused"]


def _text(line: Line) -> Text:
    text = Text(f"{line.grade:<9}", style=STYLES[line.grade])
    text.append(f"{line.check:<32} {line.found}", style="none")
    if line.bound:
        text.append(f"  ({line.bound})", style="dim")
    if line.remedy:
        text.append(f"\n{INDENT}-> {line.remedy}", style="none")
    return text
