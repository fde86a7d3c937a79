"""A result as tables, shown alike in a terminal, as plain text and in a notebook."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

from markupsafe import escape
from rich.console import Console
from rich.text import Text

from hil.results.tables.terminal import rich_table

if TYPE_CHECKING:
    from rich.console import ConsoleOptions, RenderResult

    from hil.results.tables.table import Table

WIDTH = 100
"""Of the plain text [characters]."""
STYLE = "<style>.wide th, .wide td { text-align: left } .wide .number { text-align: right }</style>"
"""Of a notebook, which aligns all cells to the right by itself."""


@dataclass(frozen=True, slots=True)
class Summary:
    """Tables and remarks; ``print`` it, or let a notebook show it."""

    tables: tuple[Table, ...]
    remarks: tuple[str, ...] = ()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """What rich prints."""
        del console
        for table in self.tables:
            yield rich_table(table, options.max_width)
        for remark in self.remarks:
            yield Text(remark, style="yellow")

    def __str__(self) -> str:
        text = io.StringIO()
        Console(file=text, width=WIDTH, color_system=None).print(self)
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        from hil.results.tables.html import html  # noqa: PLC0415 - Jinja, for notebooks alone

        remarks = "".join(f"<p>{escape(remark)}</p>" for remark in self.remarks)
        return STYLE + "".join(html(table) for table in self.tables) + remarks
