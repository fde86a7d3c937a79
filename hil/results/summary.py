"""A result as tables, shown alike in a terminal, as plain text and in a notebook."""

from __future__ import annotations

import io
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import ConsoleOptions, RenderResult

    Row = tuple[str, ...]

WIDTH = 100
"""Of the plain text [characters]."""


@dataclass(frozen=True, slots=True)
class Part:
    """Rows of a table that belong together, with a name in the last column or none."""

    name: str
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class Table:
    """One table.

    Attributes
    ----------
    title, caption : str
    headings : tuple of str
    figures : frozenset of int
        Columns of numbers, which are aligned to the right.
    parts : tuple of Part
    """

    title: str
    headings: Row
    figures: frozenset[int]
    parts: tuple[Part, ...]
    caption: str = ""

    def rich(self) -> RichTable:
        """As rich prints it; the last column folds where it is too wide."""
        table = RichTable(title=self.title or None, caption=self.caption or None,
                          box=box.SIMPLE_HEAD, pad_edge=False)  # fmt: skip
        last = len(self.headings) - 1
        for k, heading in enumerate(self.headings):
            table.add_column(heading, justify="right" if k in self.figures else "left",
                             no_wrap=k != last or k in self.figures, overflow="fold")  # fmt: skip
        for part in self.parts:
            if part.name:
                table.add_row(*[""] * last, Text(part.name, style="bold"))
            for row in part.rows:
                table.add_row(*row)
            table.add_section()
        return table

    def html(self) -> str:
        """As one HTML table without any style of its own but alignment."""
        head = "".join(f"<th>{escape(heading)}</th>" for heading in self.headings)
        return (
            f"<table><caption>{escape(self.title)}</caption><thead><tr>{head}</tr></thead>"
            f"<tbody>{''.join(self._html_rows())}</tbody></table>"
            + (f"<p>{escape(self.caption)}</p>" if self.caption else "")
        )

    def _html_rows(self) -> Iterator[str]:
        for part in self.parts:
            if part.name:
                span = len(self.headings)
                yield f'<tr><th colspan="{span}">{escape(part.name)}</th></tr>'
            for row in part.rows:
                sides = ("right" if k in self.figures else "left" for k in range(len(row)))
                cells = (
                    f'<td style="text-align:{side}">{escape(cell)}</td>'
                    for side, cell in zip(sides, row, strict=True)
                )
                yield f"<tr>{''.join(cells)}</tr>"


@dataclass(frozen=True, slots=True)
class Summary:
    """Tables and remarks; ``print`` it, or let a notebook show it."""

    tables: tuple[Table, ...]
    remarks: tuple[str, ...] = ()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """What rich prints."""
        del console, options
        for table in self.tables:
            yield table.rich()
        for remark in self.remarks:
            yield Text(remark, style="yellow")

    def __str__(self) -> str:
        text = io.StringIO()
        Console(file=text, width=WIDTH, color_system=None).print(self)
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        remarks = "".join(f"<p>{escape(remark)}</p>" for remark in self.remarks)
        return "".join(table.html() for table in self.tables) + remarks
