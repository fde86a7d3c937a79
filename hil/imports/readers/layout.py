"""How a text file is laid out, seen in its first lines: delimiter, decimal, header."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.imports.map_file import Format

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
"""Begin of an instant."""
MISSING = {"", "nan", "na", "null", "none", "inf", "-inf", "-nan"}
_CANDIDATES = (";", "\t", ",", "|")
_COMMENTS = ("%", "#", "//")
_LOOKED_AT = 30
_UNITS = {
    *("", "-", "1", "%", "s", "ms", "us", "µs", "ns", "min", "rad", "deg", "°", "m", "mm"),
    *(
        "rad/s",
        "deg/s",
        "°/s",
        "rpm",
        "1/min",
        "turns",
        "rev",
        "turns/s",
        "rev/s",
        "m/s",
        "mm/s",
        "nm",
        "n*m",
        "n.m",
        "n",
        "a",
        "ma",
    ),
    *("v", "mv", "counts", "inc", "counts/s", "inc/s", "rad/s^2", "rad/s2", "m/s^2", "m/s2"),
}
_IN_BRACKETS = re.compile(r"\[[^\]]*\]|\([^)]*\)")


class NoNumbers(Exception):
    """The first lines hold no row of numbers."""


@dataclass(frozen=True)
class Layout:
    """Layout of a text file.

    Attributes
    ----------
    delimiter, decimal, comment : str
        A delimiter of one space stands for any number of blanks.
    names : tuple of str
        Of the columns; empty where there is no header.
    skipped : int
        Lines before the first row.
    width : int
        Cells of the first row.
    """

    delimiter: str
    decimal: str
    comment: str
    names: tuple[str, ...]
    skipped: int
    width: int


def layout_of(text: str, stated: Format) -> Layout:
    """Layout of a file that begins with `text`, as stated or as it looks.

    Raises
    ------
    NoNumbers
        No row of numbers is found, or lines that cannot be rows.
    """
    lines = text.split("\n")
    used = [
        (number, line.strip("\r"))
        for number, line in enumerate(lines)
        if number >= stated.skip and line.strip() and not line.lstrip().startswith(stated.comment)
    ]
    if not used:
        raise NoNumbers("has no rows")
    delimiter = stated.delimiter or _delimiter([line for _, line in used[:_LOOKED_AT]])
    decimal = stated.decimal or _decimal([line for _, line in used[:_LOOKED_AT]], delimiter)
    rows = [(number, cells(line, delimiter)) for number, line in used]
    scope = any(_states_channels(row) for _, row in rows)
    first = _first_row(rows, decimal, stated, whole=scope)
    width = len(rows[first][1])
    units_below = first > 1 and _are_units(rows[first - 1][1], rows[first - 2][1])
    header = rows[first - 1 - units_below][1]
    named = tuple(header[1:] if header[0] in _COMMENTS else header)
    named = _of_scope([cells for _, cells in rows[:first]], width) or named
    names = named if first else _in_comment(lines, rows[0][0], stated)
    if len(names) != width and not (first and stated.header):
        names = () if not first else (*names, *[""] * width)[:width]
    comment = "EOF" if scope else stated.comment  # what a scope may write at the end
    return Layout(delimiter, decimal, comment, names or ("",) * width, rows[first][0], width)


def cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line; those in quotation marks may hold the delimiter."""
    if delimiter == " ":
        return line.split()
    return [cell.strip().strip('"').strip() for cell in _split(line, delimiter)]


def _split(line: str, delimiter: str) -> list[str]:
    if '"' not in line:
        return line.split(delimiter)
    return re.split(rf"{re.escape(delimiter)}(?=(?:[^\"]*\"[^\"]*\")*[^\"]*$)", line)


def _delimiter(lines: Sequence[str]) -> str:
    """The character that stands equally often in most lines; blanks where there is none."""
    for candidate in _CANDIDATES:
        counts = Counter(len(_split(line, candidate)) - 1 for line in lines)
        number, agreeing = counts.most_common(1)[0]
        if number and agreeing > 0.6 * len(lines):
            return candidate
    return " "


def _decimal(lines: Sequence[str], delimiter: str) -> str:
    if delimiter == ",":
        return "."
    found = [c for line in lines for c in cells(line, delimiter) if _NUMBER.fullmatch(c)]
    return "," if any("," in c for c in found) and not any("." in c for c in found) else "."


def _first_row(
    rows: Sequence[tuple[int, list[str]]], decimal: str, stated: Format, *, whole: bool
) -> int:
    """Index of the first row of numbers among `rows`; of a `whole` row, without any text."""
    if stated.header is not None:
        if len(rows) <= stated.header:
            raise NoNumbers("has a header and no rows")
        return int(stated.header)
    for index, (_, row) in enumerate(rows):
        numbers = sum(_is_number(cell, decimal) for cell in row)
        if numbers and all(_is_number(c, decimal) or c.lower() in MISSING for c in row):
            return index
        if index and numbers >= 2 and not whole:
            return index  # text in one of its cells, which matters only where that is wanted
    raise NoNumbers("has no row of numbers in its first lines")


def _is_number(cell: str, decimal: str) -> bool:
    if DATE.match(cell):
        return True
    return bool(_NUMBER.fullmatch(cell)) and ("." if decimal == "," else ",") not in cell


def _are_units(row: Sequence[str], above: Sequence[str]) -> bool:
    """Whether a row below a header has nothing but units."""
    return len(row) == len(above) and all(
        cell.lower().replace(" ", "") in _UNITS or _IN_BRACKETS.fullmatch(cell) for cell in row
    )


def _of_scope(above: Sequence[Sequence[str]], width: int) -> tuple[str, ...]:
    """Names where a scope states each channel's in pairs, as those of TwinCAT: Name, X, Name, Y.

    Each channel has a column of time before that of its values.
    """
    for row in above:
        if len(row) >= width > 1 and _states_channels(row):
            channels = row[1:width:2]
            return tuple(name for channel in channels for name in (f"{channel}/time", channel))
    return ()


def _states_channels(row: Sequence[str]) -> bool:
    """Whether a row names channels as a scope does; its first line names the scope alone."""
    return len(row) >= 4 and all(word == "Name" for word in row[0:4:2])


def _in_comment(lines: Sequence[str], begin: int, stated: Format) -> tuple[str, ...]:
    """Names in the comment right before the first row, as NumPy writes them."""
    before = lines[begin - 1].strip() if begin else ""
    if not before.startswith(stated.comment):
        return ()
    line = before.lstrip(stated.comment).strip()
    return tuple(cells(line, _delimiter([line])))
