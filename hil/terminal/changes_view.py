"""Tables of objects that a drive holds and what is written in their place."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

COMMUNICATION = 0x2000
"""Objects below this index are identifiers and mappings, which are read in hexadecimal."""


class Row(NamedTuple):
    """One object; `present` is None where the drive does not show it."""

    place: tuple[int, int]
    name: str
    present: int | None
    value: int


def render(label: str, rows: Sequence[Row], console: Console, column: str) -> None:
    """Print one drive's table, or that there is nothing to write."""
    if not rows:
        console.print(f"{label}: nothing differs", highlight=False, markup=False)
        return
    table = Table(title=label, title_justify="left", box=None, pad_edge=False)
    table.add_column("object")
    table.add_column("name")
    table.add_column("value on the drive", justify="right")
    table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            f"{row.place[0]:04X}:{row.place[1]:02X}",
            row.name,
            _shown(row.place[0], row.present),
            _shown(row.place[0], row.value),
        )
    console.print(table, highlight=False)


def _shown(index: int, value: int | None) -> str:
    if value is None:
        return "-"
    hexadecimal = index < COMMUNICATION and value > 0xFFFF
    return f"{value:08X}h" if hexadecimal else f"{value}"
