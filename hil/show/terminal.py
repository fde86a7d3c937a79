"""Tables and sentences on a terminal, drawn by rich."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.cells import cell_len
from rich.table import Table as RichTable
from rich.text import Text

from hil.show.table import Marked

if TYPE_CHECKING:
    from rich.console import Console

    from hil.show.table import Table


BETWEEN = 3
"""Characters between columns."""


class DrawnTable(RichTable):
    """Rich table with the source table."""

    source: Table


def rich_table(table: Table, width: int) -> DrawnTable:
    """Create the rich table; names of parts are in the first folding column.

    Parameters
    ----------
    width : int
        Characters that there is room for; where they are few, heads take several lines.
    """
    title = Text(table.title, style="table.title") if table.title else None
    # figures must never be cropped: without a folding column, fold the first one
    folding = [column.folds for column in table.columns]
    folding[:1] = [folding[0] or not any(folding)]
    narrow = sum(_widths(table, folding, broken=False)) > width
    widths = _widths(table, folding, narrow)
    made = DrawnTable(title=title, box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=narrow)
    made.source = table
    for column, folds, least in zip(table.columns, folding, widths, strict=True):
        head = Text(_break_heading(column.head) if narrow else column.head)
        made.add_column(
            head,
            justify=column.align,
            no_wrap=not folds,
            overflow="fold",
            min_width=least - BETWEEN,
        )
    for part in table.parts:
        if part.name:
            made.add_row(*[""] * folding.index(True), Text(part.name, style="bold"))
        for row in part.rows:
            made.add_row(*(Text(cell, style=_style(cell)) for cell in row))
        made.add_section()
    return made


def show(table: Table, console: Console) -> None:
    """Print a table with rows, and notes below."""
    if table:
        made = rich_table(table, console.width)
        # a table too wide for the terminal wraps instead of being cropped
        needed = console.measure(made, options=console.options.update(max_width=10_000)).minimum
        made.width = needed if needed > console.width else None
        console.print(made, highlight=False, crop=False)
    for note in table.notes:
        show_remark(note, console)


def show_sentence(text: str, console: Console) -> None:
    """Print a line next to a table; nothing if empty."""
    if text:
        console.print(Text(text), highlight=False, soft_wrap=True)


def show_remark(text: str, console: Console) -> None:
    """Print a remark about the result above."""
    console.print(Text(text, style="yellow"), highlight=False, soft_wrap=True)


def _widths(table: Table, folding: list[bool], broken: bool, least: int = 12) -> list[int]:
    """Compute column widths in characters, spacing included; folding columns need `least`."""
    found = []
    for k, (column, folds) in enumerate(zip(table.columns, folding, strict=True)):
        head = _break_heading(column.head) if broken else column.head
        cells = [*head.split("\n"), *(row[k] for row in table.rows)]
        longest = max(map(cell_len, cells))
        found.append(BETWEEN + (min(longest, least) if folds else longest))
    return found


def _break_heading(head: str) -> str:
    """Break the words of a heading into lines, with the unit on a line."""
    name, comma, unit = head.rpartition(", ")
    return f"{name.replace(' ', chr(10))},\n{unit}" if comma else head.replace(" ", "\n")


def _style(cell: str) -> str:
    return "bold red" if isinstance(cell, Marked) else ""
