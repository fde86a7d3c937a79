"""Tables of objects that a drive holds and what is written in their place."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console


class ObjectChange(NamedTuple):
    """One object, its value on the drive (a dash where it cannot be read), and the one written."""

    place: str
    name: str
    present: str
    value: str


def render(label: str, rows: Sequence[ObjectChange], console: Console, column: str) -> None:
    """Print one drive's table, or that there is nothing to write."""
    if not rows:
        console.print(f"{label}: nothing differs", highlight=False, markup=False)
        return
    table = Table(title=Text(label), title_justify="left", box=None, pad_edge=False)
    table.add_column("object")
    table.add_column("name")
    table.add_column("value on the drive", justify="right")
    table.add_column(column, justify="right")
    for row in rows:
        table.add_row(row.place, Text(row.name), row.present, row.value)
    console.print(table, highlight=False)
