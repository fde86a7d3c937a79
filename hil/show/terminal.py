"""Tables and sentences on a terminal.

A table wider than the terminal changes as little as it must, in this order: headings take several
lines; cells of folding columns take several lines; the last column moves below each row; the
columns are drawn in several blocks, with those that name the rows repeated. No number is cut, and
no number is separated from its uncertainty and unit.

Tables of rich have no blocks, no row below a row and no unbreakable quantities, and rich cuts long
words when wrapping a text. Therefore rich wraps only the cells here.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from textwrap import fill
from typing import TYPE_CHECKING

from rich.cells import cell_len
from rich.text import Text

from hil.show.table import Marked

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rich.console import Console, ConsoleOptions, RenderResult

    from hil.show.table import Row, Table

BETWEEN, CLOSE = 3, 2
"""Characters between columns, in a wide and in a narrow table."""
MARGIN = 1
FOLDED = 10
"""Width that a folding column keeps [characters]."""
COMFORTABLE = 24
"""Width below which the last column moves below the rows [characters]."""
NAME = r"(?:N|m|mm|kg|rad|µrad|deg|s|ms|A|h|Hz|%)"
UNIT = rf"(?:{NAME}(?:[²/^(][^\s,;]*)?|\([a-z]+/[^\s,;]*)(?=[\s,;)]|$)"
QUANTITY = re.compile(rf"(?:\b\w+ )?[−-]?\d[\d.]* ± [\d.]+(?: {UNIT})*|[−-]?\d[\d.]*(?: {UNIT})+")
ALONE = re.compile(rf"(?<=, ){UNIT}(?: {UNIT})*$")
"""Unit at the end of a heading."""
GLUE = "\ue000"
"""Non-breaking blank, a character of the private use area; replaced before output."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """Table drawn by a console at its present width."""

    source: Table

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines."""
        table, width = self.source, options.max_width
        blocks = list(_arrange(table, width))
        if table.title:
            room = max(MARGIN + blocks[0].width, min(cell_len(table.title), width))
            for line in _wrap(table.title, room, console):
                yield _line(" " * ((room - cell_len(line)) // 2), (line, "table.title"))
            yield _line()
        for block in blocks:
            yield from _draw_block(table, block, width, console)


@dataclass(frozen=True, slots=True)
class _Block:
    """Columns drawn side by side, with widths, and the column below each row, after `indent`."""

    columns: Sequence[int]
    widths: Sequence[int]
    gap: int
    below: int | None
    indent: int

    @property
    def width(self) -> int:
        """Characters of a line, without the margin."""
        return sum(self.widths) + self.gap * (len(self.widths) - 1)


def show(table: Table, console: Console) -> None:
    """Print a table with rows, and notes below."""
    if table:
        console.print(Drawn(table), highlight=False, crop=False)
    for note in table.notes:
        show_remark(note, console)


def show_sentence(text: str, console: Console, style: str = "") -> None:
    """Print a line next to a table; nothing if empty."""
    if text:
        made = Text(broken(text, console), style=style)
        console.print(made, highlight=False, soft_wrap=True)


def show_remark(text: str, console: Console) -> None:
    """Print a remark about the result above."""
    show_sentence(text, console, "yellow")


def show_beside(head: Text, text: str, indent: int, console: Console) -> None:
    """Print a heading and a text in a column beside it; in a file, on one line."""
    room = console.width - indent
    lines = _wrap(text, room, console) if console.is_terminal and room >= FOLDED else [text]
    if len(lines) > 1 and cell_len(head.plain) >= indent:
        lines = ["", *lines]
    for number, line in enumerate(lines):
        start = head if number == 0 else Text("")
        blank = " " * max(indent - cell_len(start.plain), 1 if start.plain else 0)
        made = Text.assemble(start, blank, line)
        made.rstrip()
        console.print(made, highlight=False, soft_wrap=True)


def broken(text: str, console: Console) -> str:
    """Return a text whose lines end between words on a terminal.

    Lines of a file, and commands to be copied, stay whole; so do words such as paths.
    """
    if not console.is_terminal:
        return text
    return "\n".join(
        line
        if cell_len(line) <= console.width or line.startswith("hil ")
        else fill(
            _glued(line),
            console.width,
            expand_tabs=False,
            replace_whitespace=False,
            break_long_words=False,
            break_on_hyphens=False,
        ).replace(GLUE, " ")
        for line in text.split("\n")
    )


def _draw_block(table: Table, block: _Block, width: int, console: Console) -> Iterator[Text]:
    indent = " " * (MARGIN + block.indent)
    heads = tuple(column.head for column in table.columns)
    yield from _draw_row(table, block, heads, console, bottom=True)
    if block.below is not None:
        yield _line(indent, heads[block.below])
    yield _line(" " * MARGIN, "─" * block.width)
    for number, part in enumerate(table.parts):
        if number:
            yield _line()
        if part.name:
            yield from (_line(indent, (each, "bold")) for each in
                        _wrap(part.name, width - len(indent), console))  # fmt: skip
        for row in part.rows:
            yield from _draw_row(table, block, row, console)
            if block.below is not None and row[block.below]:
                for each in _wrap(row[block.below], width - len(indent), console):
                    yield _line(indent, each)
    yield _line()


def _draw_row(
    table: Table, block: _Block, row: Row, console: Console, *, bottom: bool = False
) -> Iterator[Text]:
    """Draw cells as lines; those of headings end with the last line (`bottom`)."""
    cells = [
        _wrap(row[k], each, console) if cell_len(row[k]) > each else [row[k]]
        for k, each in zip(block.columns, block.widths, strict=True)
    ]
    height = max(map(len, cells))
    for at in range(height):
        pieces: list[tuple[str, str]] = []
        for k, each, cell in zip(block.columns, block.widths, cells, strict=True):
            own = at - (height - len(cell) if bottom else 0)
            text = cell[own] if 0 <= own < len(cell) else ""
            blank = " " * (each - cell_len(text))
            style = "bold red" if isinstance(row[k], Marked) else ""
            first, second = (blank, "") if table.columns[k].align == "right" else ("", blank)
            pieces += [(first, ""), (text, style), (second + " " * block.gap, "")]
        yield _line(" " * MARGIN, *pieces)


def _arrange(table: Table, width: int) -> Iterator[_Block]:
    """Yield the blocks of a table on a terminal of `width` characters."""
    every, last = range(len(table.columns)), len(table.columns) - 1
    heads = [cell_len(column.head) for column in table.columns]
    cells = [max((cell_len(row[k]) for row in table.rows), default=0) for k in every]
    whole = [max(each) for each in zip(heads, cells, strict=True)]
    folding = [column.folds for column in table.columns]
    folding[0] |= not any(folding)
    indent = next((k for k in every if folding[k] and k < last), min(1, last))
    if MARGIN + sum(whole) + BETWEEN * last <= width:
        yield _Block(every, whole, BETWEEN, None, _start(whole, indent, BETWEEN))
        return
    least = [
        max(_halved(column.head), min(cells[k], max(FOLDED, _longest_of(table, k)))
            if folding[k] else cells[k])
        for k, column in enumerate(table.columns)
    ]  # fmt: skip
    columns, below = list(every), None
    room = width - MARGIN - CLOSE * last - sum(
        min(cells[k], COMFORTABLE) if folding[k] else least[k] for k in every[:-1]
    )  # fmt: skip
    if folding[last] and sum(folding) <= 2 and last and room < min(cells[last], COMFORTABLE):
        columns, below = columns[:-1], last
    named = 1
    while named < len(columns) and table.columns[named].align == "left" and (
        sum(least[: named + 1]) + CLOSE * named < width / 2
    ):  # fmt: skip
        named += 1
    names = columns[:named]
    while columns:
        taken = columns[:]
        while len(taken) > named + 1 and _needed(taken, least) > width:
            taken.pop()
        # share the width of the terminal: first for folding columns, then for headings
        found = {k: least[k] for k in taken}
        free = width - _needed(taken, least)
        order = sorted((k for k in taken if folding[k]), key=lambda k: cells[k] - found[k])
        for number, k in enumerate(order):
            more = min(max(cells[k] - found[k], 0), max(free, 0) // (len(order) - number))
            found[k], free = found[k] + more, free - more
        fits = sum(max(heads[k] - found[k], 0) for k in taken) <= free
        widths = [max(found[k], heads[k]) if fits else found[k] for k in taken]
        start = _start(widths, min(indent, len(taken) - 1), CLOSE)
        yield _Block(taken, widths, CLOSE, below, start)
        further = [k for k in columns if k not in taken]
        columns, below = [*names, *further] if further else [], None


def _needed(taken: Sequence[int], least: Sequence[int]) -> int:
    return MARGIN + sum(least[k] for k in taken) + CLOSE * (len(taken) - 1)


def _start(widths: Sequence[int], column: int, gap: int) -> int:
    return sum(widths[:column]) + gap * column


def _longest(text: str) -> int:
    """Return the length of the longest piece that is never broken."""
    return max(map(cell_len, _glued(text).split()), default=0)


def _halved(head: str) -> int:
    """Return the least width at which a heading takes at most two lines."""
    words = _glued(head).split()
    halves = (max(map(cell_len, (" ".join(words[:k]), " ".join(words[k:])))) for k in
              range(len(words)))  # fmt: skip
    return min(halves, default=0)


def _longest_of(table: Table, k: int) -> int:
    """Return the longest piece of a folding column, at most twice `FOLDED`."""
    return min(max((_longest(row[k]) for row in table.rows), default=0), 2 * FOLDED)


def _wrap(text: str, width: int, console: Console) -> list[str]:
    lines = Text(_glued(text)).wrap(console, max(width, 1), overflow="fold")
    return [line.plain.rstrip().replace(GLUE, " ") for line in lines]


def _glued(text: str) -> str:
    """Return the text with `GLUE` in place of the blanks within quantities and units."""
    for pattern in (QUANTITY, ALONE):
        text = pattern.sub(lambda found: found[0].replace(" ", GLUE), text)
    return text.replace("± ", f"±{GLUE}")


def _line(*pieces: str | tuple[str, str]) -> Text:
    made = Text.assemble(*pieces, no_wrap=True, overflow="ignore")
    made.rstrip()
    return made
