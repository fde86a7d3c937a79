"""Tables on a terminal, rich_table by rich."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.table import Table as RichTable
from rich.text import Text

from hil.results.tables.table import Marked

if TYPE_CHECKING:
    from rich.console import Console

    from hil.results.tables.table import Table


def rich_table(table: Table) -> RichTable:
    """Return what rich prints of a table; names of parts stand in its last column."""
    title = Text(table.title, style="table.title") if table.title else None
    made = RichTable(title=title, box=box.SIMPLE_HEAD, pad_edge=False)
    # figures are never to be cropped: where no column folds by itself, the first one does
    folding = [column.folds for column in table.columns]
    folding[:1] = [folding[0] or not any(folding)]
    for column, folds in zip(table.columns, folding, strict=True):
        made.add_column(Text(column.head), justify=column.align, no_wrap=not folds,
                        overflow="fold")  # fmt: skip
    for part in table.parts:
        if part.name:
            made.add_row(*[""] * (len(table.columns) - 1), Text(part.name, style="bold"))
        for row in part.rows:
            made.add_row(*(Text(cell, style=_style(cell)) for cell in row))
        made.add_section()
    return made


def show(table: Table, console: Console) -> None:
    """Print a table, if it has rows, with its notes below."""
    if table:
        console.print(rich_table(table), highlight=False)
    for note in table.notes:
        show_remark(note, console)


def show_sentence(text: str, console: Console) -> None:
    """Print a line beside a table; none if it is empty."""
    if text:
        console.print(Text(text), highlight=False, soft_wrap=True)


def show_remark(text: str, console: Console) -> None:
    """Print a line that restricts what stands above."""
    console.print(Text(text, style="yellow"), highlight=False, soft_wrap=True)


def _style(cell: str) -> str:
    return "bold red" if isinstance(cell, Marked) else ""
