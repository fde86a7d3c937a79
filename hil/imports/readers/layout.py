"""Layout of a text file, detected in its first lines: delimiter, decimal, header."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING

from checked_files.foreign_text import one_line
from hil.imports.tables import SPELLINGS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.imports.map_file import Format

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
_QUOTED = re.compile(rb'"[^"\n]*"')
_GROUPED = {
    mark: re.compile(
        rb"(?<![\d.,])\d{1,3}(?:%b\d{3})+(?![\d%b])"
        % (re.escape(mark.encode()), re.escape(mark.encode()))
    )
    for mark in ",."
}
"""Digits in groups of three, by separator."""
_THOUSANDS = {
    ",": re.compile(r"[+-]?\d{1,3}(,\d{3})+\.\d*"),
    ".": re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d*"),
}
"""Numbers with separators of thousands and of decimals, which cannot be read in another way."""
_GROUPED_CELL = re.compile(r"[+-]?\d[\d.,]*")
DATE = re.compile(r"(\d{4}-\d\d-\d\d[T ]|(\d\d?)\.(\d\d?)\.(\d{4})[T ])?\d\d:\d\d:")
"""Pattern of the start of an instant: a date (year or day first) or none, and the time of day."""
_ZONE = re.compile(r"\s*(?:Z|UTC|GMT|([+-]\d\d(?::?\d\d)?))?\s*(?:\[.*\])?$")
"""Pattern of the end of an instant: an offset from UTC, and the name of a zone."""
MISSING = {"", "nan", "na", "null", "none", "inf", "-inf", "-nan"}
_CANDIDATES = (";", "\t", ",", "|")
_COMMENTS = ("%", "#", "//")
_END_OF_SETTINGS = "***End_of_Header***"
"""Last line of the settings in a measurement file of LabVIEW."""
_LOOKED_AT = 30
_ABOVE = 5
"""Rows above the numbers that may hold the names, since comments, types and units follow names."""
_UNITS = {"", "-", "1", "%", "ma", "mv", "rad/s^2", "rad/s2", "m/s^2", "m/s2"}.union(
    *SPELLINGS.values()
)
"""Units in the row below the names, in small letters without blanks."""
_IN_BRACKETS = re.compile(r"\[[^\]]*\]|\([^)]*\)")


JOINT_WORDS = {"joint", "axis", "motor", "servo", "id", "name", "index"}
"""Words in the name of a column that numbers the joints of a long layout."""


class NoNumbers(Exception):
    """First lines without a row of numbers."""


class LongLayout(Exception):
    """Rows of a single joint or value each; the message states how to widen the table."""


@dataclass(frozen=True)
class Layout:
    """Layout of a text file.

    Attributes
    ----------
    delimiter, decimal, comment : str
        A delimiter of one space stands for any number of blanks.
    names : tuple of str
        Names of the columns, ``NAME [UNIT]`` with a row of units below; empty without a header.
    skipped : int
        Lines before the first row.
    width : int
        Cells of the first row.
    clocks : tuple of int
        Column of the time stamps for all columns of a scope; else empty.
    lists : bool
        True for cells that hold lists of numbers (`hil.imports.readers.lists`).
    thousands : str
        Separator of thousands, or none; one that is the delimiter too stands in quotation marks.
    header : frozenset of str
        Cells of the lines above the first row, by which a repeated header is found.
    """

    delimiter: str
    decimal: str
    comment: str
    names: tuple[str, ...]
    skipped: int
    width: int
    clocks: tuple[int, ...] = ()
    lists: bool = False
    thousands: str = ""
    header: frozenset[str] = frozenset()

    def join_thousands(self, text: bytes) -> bytes:
        """Return a text without separators of thousands."""
        mark = self.thousands.encode()
        if not mark or mark not in text:
            return text
        if self.thousands == self.delimiter:
            return _QUOTED.sub(lambda found: found[0].replace(mark, b""), text)
        return _GROUPED[self.thousands].sub(lambda found: found[0].replace(mark, b""), text)


def decoded(head: bytes) -> str:
    """Decode UTF-8, or Latin-1 as written by older programs, for example for a degree sign."""
    try:
        return head.decode("utf-8-sig")
    except UnicodeDecodeError:
        return head.decode("latin-1")


def layout_of(text: str, stated: Format) -> Layout:
    """Return the layout of a file beginning with `text`, as stated or as detected.

    Raises
    ------
    NoNumbers
        No row of numbers is found, or lines that cannot be rows.
    LongLayout
        Each row holds the values of one joint, or one value.
    """
    lines = text.split("\n")
    settings = [number for number, line in enumerate(lines) if line.startswith(_END_OF_SETTINGS)]
    begin = max(stated.skip, 1 + max(settings, default=-1))
    used = [
        (number, line.strip("\r"))
        for number, line in enumerate(lines)
        if number >= begin and line.strip() and not line.lstrip().startswith(stated.comment)
    ]
    if not used:
        raise NoNumbers("has no rows")
    last = [line for _, line in used[-_LOOKED_AT:]]  # without lines of settings
    delimiter = stated.delimiter or _delimiter(last)
    rows = [(number, cells(line, delimiter)) for number, line in used]
    thousands = _thousands([row for _, row in rows[-_LOOKED_AT:]], stated)
    if thousands:
        rows = [
            (n, [c.replace(thousands, "") if _GROUPED_CELL.fullmatch(c) else c for c in row])
            for n, row in rows
        ]
    decimal = {"": stated.decimal, ",": ".", ".": ","}[thousands] or _decimal(last, delimiter)
    scope = _find_scope_row([row for _, row in rows])
    first = _first_row(rows, delimiter, decimal, stated, whole=bool(scope))
    skipped, width = rows[first][0], len(rows[first][1])
    if scope:
        # a scope may end its file with EOF
        units = next((row for _, row in rows if row[0] == "Unit"), ())
        return Layout(delimiter, decimal, "EOF", *_channels(scope, units, width, skipped))
    above = [row for _, row in rows[max(0, first - _ABOVE) : first]]
    names = _names(above) if first else _find_comment_names(lines, rows[0][0], stated)
    if len(names) != width and not (first and stated.header):
        names = () if not first else (*names, *[""] * width)[:width]
    _refuse_long([row for _, row in rows[first:]], names or ("",) * width, delimiter, decimal)
    return Layout(
        delimiter,
        decimal,
        stated.comment,
        names or ("",) * width,
        skipped,
        width,
        thousands=thousands,
        header=frozenset(cell for row in above for cell in row if cell),
    )


def _refuse_long(
    rows: Sequence[Sequence[str]], names: Sequence[str], delimiter: str, decimal: str
) -> None:
    """Refuse rows of which several in turn have one stamp and the names of different joints."""
    if {"_time", "_field", "_value"} <= set(names):  # of InfluxDB
        tags = [n for n in names if n and n[0] != "_" and n not in {"result", "table"}]
        tags = ["_field", *["_measurement"] * ("_measurement" in names), *tags]
        read = ", comment='#', parse_dates=['_time'], date_format='ISO8601'"
        raise LongLayout(
            "is in InfluxDB's long layout: each row has one value, with its name in _field;"
            + _widen(read, "_time", f"{tags}, values='_value'")
        )
    whole = [row for row in rows if len(row) == len(names)][:-1]  # the last one may be cut
    keys = [name or column for column, name in enumerate(names)]
    for column, name in enumerate(names):
        joints = list(dict.fromkeys(row[column] for row in whole))
        text = not any(_is_number(each, decimal) or each.lower() in MISSING for each in joints)
        numbered = JOINT_WORDS.intersection(re.findall("[a-z]+", name.lower()))
        if not 2 <= len(joints) <= len(whole) / 3 or not (text or numbered):
            continue
        for stamp in set(range(len(names))) - {column}:
            groups = [
                [row[column] for row in group] for _, group in groupby(whole, itemgetter(stamp))
            ]
            several = all(len(each) == len(set(each)) for each in groups)
            stamps = len({row[stamp] for row in whole})
            if several and 2 < stamps == len(groups) < len(whole) / 1.5:
                read = "" if any(names) else ", header=None"
                blanks = delimiter.replace(" ", r"\s+")
                read += f", sep={blanks!r}" * (delimiter != ",")
                read += f", decimal={decimal!r}" * (decimal != ".")
                if DATE.match(whole[0][stamp]):
                    read += f", parse_dates=[{keys[stamp]!r}], date_format='ISO8601'"
                raise LongLayout(
                    f"is in a long layout: each {keys[stamp]} has {max(map(len, groups))} rows, "
                    f"one for each of {', '.join(joints[:12])} in column {keys[column]};"
                    + _widen(read, keys[stamp], repr(keys[column]))
                )


def _widen(read: str, index: object, columns: str) -> str:
    """Return the remedy for a long layout: a table with a row for each stamp."""
    return (
        f" make a row of each {index}, as by pandas: d = pandas.read_csv(FILE{read}).pivot("
        f"index={index!r}, columns={columns}); d.columns = ['_'.join(map(str, c)) for c in"
        " d.columns]; d.to_csv('wide.csv')"
    )


def instant(cell: str) -> str:
    """Return an instant with its date first, 1970 without a date."""
    found = DATE.match(cell)
    if found and found[4]:
        cell = f"{found[4]}-{found[3]:0>2}-{found[2]:0>2}T{cell[found.end(4) + 1 :]}"
    elif not (found and found[1]):
        cell = f"1970-01-01T{cell}"
    return _ZONE.sub(lambda found: found[1] or "", cell, count=1)


def cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; quoted cells may hold the delimiter."""
    if delimiter == " ":
        return line.split()
    return [cell.strip().strip('"').strip() for cell in _split(line, delimiter)]


def _split(line: str, delimiter: str) -> list[str]:
    """Split a line at the delimiters that an even number of quotation marks follows."""
    found: list[str] = []
    cell: list[str] = []
    parts = line.split('"')
    for number, part in enumerate(parts):
        first, *rest = part.split(delimiter) if (len(parts) - number) % 2 else [part]
        cell.append(first)
        if rest:
            found += ['"'.join(cell), *rest[:-1]]
            cell = rest[-1:]
    return [*found, '"'.join(cell)]


def _delimiter(lines: Sequence[str]) -> str:
    """Return the delimiter in most lines (commas: in equal number), or a blank without one."""
    for candidate in _CANDIDATES:
        counts = Counter(len(_split(line, candidate)) - 1 for line in lines)
        equal = max((n for number, n in counts.items() if number), default=0)
        agreeing = equal if candidate == "," else len(lines) - counts[0]
        if agreeing > 0.6 * len(lines):
            return candidate
    return " "


def _thousands(rows: Sequence[Sequence[str]], stated: Format) -> str:
    """Return the separator of thousands if numbers with both separators reveal the roles."""
    found = {
        mark for mark, shape in _THOUSANDS.items() for row in rows if any(map(shape.fullmatch, row))
    }
    found -= {stated.decimal}
    return found.pop() if len(found) == 1 else ""


def _decimal(lines: Sequence[str], delimiter: str) -> str:
    if delimiter == ",":
        return "."
    found = [c for line in lines for c in cells(line, delimiter) if _NUMBER.fullmatch(c)]
    return "," if any("," in c for c in found) and not any("." in c for c in found) else "."


def _first_row(
    rows: Sequence[tuple[int, list[str]]],
    delimiter: str,
    decimal: str,
    stated: Format,
    *,
    whole: bool,
) -> int:
    """Return the index of the first row of numbers in `rows`; with `whole`, without any text."""
    if stated.header is not None:
        if len(rows) <= stated.header:
            raise NoNumbers("has a header and no rows")
        return int(stated.header)
    if not whole and _lacks_names([row for _, row in rows[:2]], decimal):
        return 0
    for index, (_, row) in enumerate(rows):
        numbers = sum(_is_number(cell, decimal) for cell in row)
        if numbers and all(_is_number(c, decimal) or c.lower() in MISSING for c in row):
            return index
        # a row may contain text in unwanted cells; settings of a recorder have fewer cells than
        # rows
        as_wide = index + 1 == len(rows) or len(row) >= len(rows[index + 1][1])
        if index and numbers >= 2 and as_wide and not whole:
            return index
    first = one_line(delimiter.join(rows[0][1]), 60)
    raise NoNumbers(f"has no row of numbers in its first lines, the first is {first!r}")


def _lacks_names(rows: Sequence[Sequence[str]], decimal: str) -> bool:
    """Return True if two rows have numbers in the same cells: the first row is not the names."""
    first, *others = ([_is_number(cell, decimal) for cell in row] for row in rows)
    return sum(first) > 1 and others == [first]


def _is_number(cell: str, decimal: str) -> bool:
    if DATE.match(cell):
        return True
    return bool(_NUMBER.fullmatch(cell)) and ("." if decimal == "," else ",") not in cell


def _names(above: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the names in the rows above the numbers: the last row that has no units or types."""
    chosen, units = list(above[-1]), [""] * len(above[-1])
    for lower, row in zip(above[::-1], above[-2::-1], strict=False):
        if len(row) != len(lower):
            break
        if all(
            cell.lower().replace(" ", "") in _UNITS or _IN_BRACKETS.fullmatch(cell)
            for cell in lower
        ):
            units = [cell.strip("[]() ") for cell in lower]
        elif not (len(set(row)) == len(row) and all(row) and len(set(lower)) < len(lower)):
            break  # comments or types repeat words below distinct names
        chosen = list(row)
    return tuple(map(_add_unit, chosen, units))[chosen[0] in _COMMENTS :]


def _add_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if name and unit and not _IN_BRACKETS.search(name) else name


def _find_scope_row(rows: Sequence[Sequence[str]]) -> Sequence[str]:
    """Return the row with the names of a scope's channels (TwinCAT); empty if there is none.

    The row has the word Name in place of the stamps of each group of channels, as before the
    scope's own name.
    """
    named = [row for row in rows if row[0] == "Name"]
    if named and (len(named) > 1 or (len(named[0]) > 2 and named[0].count("Name") > 1)):
        return named[-1]
    return ()


def _channels(
    row: Sequence[str], units: Sequence[str], width: int, skipped: int
) -> tuple[tuple[str, ...], int, int, tuple[int, ...]]:
    """Return names, lines before the first row, width, and stamp columns of a scope's channels.

    The row of units has pairs of the word Unit and a unit with its kind, such as deg (Angle).
    """
    row, units = ((*each, *[""] * width)[:width] for each in (row, units))
    clocks: list[int] = []
    for column, cell in enumerate(row):
        clocks.append(column if cell == "Name" else clocks[-1])
    names = tuple(
        f"{row[column + 1]}/time"
        if clock == column and column + 1 < width
        else _add_unit(cell, units[column].partition("(")[0].strip())
        for column, (cell, clock) in enumerate(zip(row, clocks, strict=True))
    )
    return names, skipped, width, tuple(clocks)


def _find_comment_names(lines: Sequence[str], begin: int, stated: Format) -> tuple[str, ...]:
    """Return names in the comment right before the first row, as written by NumPy."""
    before = lines[begin - 1].strip() if begin else ""
    if not before.startswith(stated.comment):
        return ()
    line = before.lstrip(stated.comment).strip()
    return tuple(cells(line, _delimiter([line])))
