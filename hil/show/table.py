"""Tables of plain strings, independent of the display."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Iterable

Row = tuple[str, ...]


class Marked(str):
    """Text of a highlighted cell."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Column:
    """Column of a table.

    Attributes
    ----------
    align : {"left", "right"}
        Alignment of the cells; figures are right-aligned.
    folds : bool
        True if cells may take several lines.
    symbols : bool
        True if cells are names and expressions of parameters, such as ``l1^2 Izz2``.
    """

    head: str
    align: Literal["left", "right"] = "left"
    folds: bool = False
    symbols: bool = False


@dataclass(frozen=True, slots=True)
class Part:
    """Group of rows, with optional name."""

    rows: tuple[Row, ...]
    name: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Table; false without rows.

    Attributes
    ----------
    title : str
        Title, a noun phrase.
    columns : tuple of Column
        Columns; the first one names the rows.
    explanation : str
        Meaning of the columns, in sentences, shown on pages.
    notes : tuple of str
        Restrictions of the figures, a line each.

    Raises
    ------
    ValueError
        The number of cells in a row differs from the number of columns.
    """

    title: str
    columns: tuple[Column, ...]
    parts: tuple[Part, ...]
    explanation: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"{self.title}: {row} must have {len(self.columns)} cells")

    def __bool__(self) -> bool:
        return bool(self.rows)

    @property
    def rows(self) -> tuple[Row, ...]:
        """Rows of the parts."""
        return tuple(row for part in self.parts for row in part.rows)


def figures(*heads: str) -> tuple[Column, ...]:
    """Create columns of figures."""
    return tuple(Column(head, "right") for head in heads)


def table(
    title: str,
    columns: Iterable[str | Column],
    rows: Iterable[Row | Part],
    explanation: str = "",
    notes: tuple[str, ...] = (),
) -> Table:
    """Create a table from rows or parts; a plain heading makes a text column."""
    made = tuple(Column(each) if isinstance(each, str) else each for each in columns)
    given = tuple(rows)
    parts = tuple(each for each in given if isinstance(each, Part))
    own = tuple(each for each in given if not isinstance(each, Part))
    return Table(title, made, (*parts, Part(own)) if own else parts, explanation, notes)
