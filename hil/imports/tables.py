"""Tables: files of recordings as columns of numbers, read in blocks of rows.

Readers (`hil.imports.readers`) make tables; no other module knows the format of a recording. Units
are those of times, positions, velocities and torques in recordings; all are converted to SI. A unit
is angular or linear, so that millimetres of a revolute joint are refused. Counts and currents have
neither: the map states their size.
"""

from __future__ import annotations

import difflib
import math
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from checked_files.budget import refuse_beyond
from checked_files.foreign_text import whole_line
from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.arrays import Array

ROWS = 1 << 16
"""Approximate number of rows of a block."""
_SHOWN, _LISTED = 12, 4
"""Maximum numbers of column names, and of left-out parts of a file, in a message."""
TimeUnit = Literal["s", "ms", "us", "100 ns", "ns", "min", "days"]
PositionUnit = Literal["rad", "deg", "turns", "rev", "m", "mm", "counts"]
VelocityUnit = Literal["rad/s", "deg/s", "turns/s", "rev/s", "rpm", "m/s", "mm/s", "counts/s"]
TorqueUnit = Literal["N m", "N", "A", "V", "%", "per mille"]

SECONDS: dict[TimeUnit, float] = {
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "100 ns": 1e-7, "ns": 1e-9, "min": 60.0,
    "days": 86400.0,
}  # fmt: skip
"""Seconds per unit of time [s]."""
_FROM_1970 = {1970: 0.0}
_ORIGINS: dict[TimeUnit, dict[int, float]] = {
    **dict.fromkeys(("s", "ms", "us", "ns"), _FROM_1970),
    "100 ns": {1601: 11_644_473_600.0, 1: 62_135_596_800.0},
    "days": {0: 719_529 * 86400.0},
}
"""Years from which dates are counted, with the seconds up to 1970: Unix, Windows, .NET, MATLAB."""
_DATES = (9.4e8, 4.1e9)
"""Seconds since 1970 in 2000 and 2099."""
STAMP_UNITS: tuple[TimeUnit, TimeUnit] = ("s", "ns")
"""Units of the two stamp columns of a format."""
LENGTHS: dict[str, float] = {
    "rad": 1.0,
    "deg": math.pi / 180,
    **dict.fromkeys(("turns", "rev"), math.tau),
    "m": 1.0,
    "mm": 1e-3,
}
"""Size of units of position, and with /s of velocity [rad or m]; not defined for counts."""
JOINT_TYPES: dict[str, str] = {
    **dict.fromkeys(("rad", "deg", "turns", "rev"), "revolute"),
    **dict.fromkeys(("rad/s", "deg/s", "turns/s", "rev/s", "rpm", "N m"), "revolute"),
    **dict.fromkeys(("m", "mm", "m/s", "mm/s", "N"), "prismatic"),
}
"""Joint types of units on the joint side; other units suit both."""
SPELLINGS: dict[str, dict[str, str]] = {
    "time": {
        **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
        **dict.fromkeys(("ms", "msec", "millisec", "milliseconds"), "ms"),
        **dict.fromkeys(("us", "\u00b5s", "\u03bcs", "usec", "microseconds"), "us"),
        **dict.fromkeys(("ns", "nsec", "nanoseconds"), "ns"),
        "min": "min",
        **dict.fromkeys(("day", "days", "datenum"), "days"),
    },
    "position": {
        **dict.fromkeys(("rad", "radian", "radians"), "rad"),
        **dict.fromkeys(("deg", "°", "degree", "degrees", "grad"), "deg"),
        **dict.fromkeys(("turn", "turns", "rev", "revs", "revolutions"), "turns"),
        **dict.fromkeys(("m", "meter", "meters"), "m"),
        "mm": "mm",
        **dict.fromkeys(("cnt", "cnts", "count", "counts", "inc", "incs", "increments"), "counts"),
    },
    "velocity": {
        **dict.fromkeys(("rad/s", "rad/sec"), "rad/s"),
        **dict.fromkeys(("deg/s", "deg/sec", "°/s", "grad/s"), "deg/s"),
        **dict.fromkeys(("turn/s", "turns/s", "rev/s", "rev/sec"), "turns/s"),
        **dict.fromkeys(("rpm", "1/min", "u/min", "rev/min"), "rpm"),
        "m/s": "m/s",
        "mm/s": "mm/s",
        **dict.fromkeys(("cnt/s", "counts/s", "cnt/sec", "counts/sec", "inc/s"), "counts/s"),
    },
    "torque": {
        **dict.fromkeys(("nm", "n*m", "n.m", "n\u00b7m", "newtonmeter"), "N m"),
        "n": "N",
        **dict.fromkeys(("a", "aeff", "arms", "a_rms", "amp", "amps", "ampere"), "A"),
        **dict.fromkeys(("v", "volt", "volts"), "V"),
        **dict.fromkeys(("%", "percent"), "%"),
        **dict.fromkeys(("\u2030", "permille"), "per mille"),
    },
}
"""Units of maps by their spellings in names of columns, in small letters without blanks."""
NEEDS_GAIN = ("A", "V", "%", "per mille")
"""Units of torque that need a gain."""


def units_of_date(stamp: float) -> dict[TimeUnit, int]:
    """Return the units in which a stamp is a date of this century, with the year of its origin."""
    return {
        unit: year
        for unit, origins in _ORIGINS.items()
        for year, before in origins.items()
        if _DATES[0] < stamp * SECONDS[unit] - before < _DATES[1]
    }


class NoColumn(Exception):
    """Missing column; the message states the available columns."""


class Table(Protocol):
    """File of a recording.

    Attributes
    ----------
    names : tuple of str
        Names of all columns; empty for unnamed columns.
    time : tuple of int
        Columns whose sum is the time stamp, in `STAMP_UNITS`, for formats with stamps.
    left_out : mapping of str to str
        Left-out contents of the file by name: description, and how to save it as numbers.
    notes : tuple of str
        Notes on the file as a whole, as clauses.
    """

    path: Path
    names: tuple[str, ...]
    time: tuple[int, ...]
    left_out: Mapping[str, str]
    notes: tuple[str, ...]

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Yield blocks of columns (from 0): arrays (n, len(columns)), NaN for missing values.

        Raises
        ------
        FileError
            The file cannot be read, or contains other values than numbers.
        """
        ...


def column_of(table: Table, column: int | str) -> int:
    """Return the index, from 0, of a column given by number from 1 or by name.

    A name may omit the unit, ``[UNIT]``.

    Raises
    ------
    NoColumn
        The column does not exist.
    """
    if isinstance(column, int):
        if column <= len(table.names):
            return column - 1
        raise NoColumn(f"{table.path} has {len(table.names)} columns, but no column {column}")
    names = list(enumerate(table.names))
    found = [index for index, name in names if name == column]
    found = found or [index for index, name in names if name.rpartition("[")[0].rstrip() == column]
    if len(found) == 1:
        return found[0]
    quoted = f"'{whole_line(column)}'"  # escaped names are not escaped again
    if found:
        numbers = " and ".join(str(index + 1) for index in found)
        raise NoColumn(f"{table.path} has {quoted} as columns {numbers}; give a number")
    for name, what in table.left_out.items():
        if column == name or (column.startswith(name) and column[len(name)] in "./({"):
            raise NoColumn(f"{table.path} has no column {quoted}: {name} is {what}")
    also = "".join(f"; {note}" for note in table.notes)
    raise NoColumn(f"{table.path} has no column {quoted}; {_offered(table.names, column)}{also}")


def _offered(names: Sequence[str], wanted: str) -> str:
    named = [name for name in names if name]
    if not named:
        return f"its {len(names)} columns have no names: give numbers from 1"
    near = difflib.get_close_matches(wanted, named, n=3, cutoff=0.5)
    if near:
        return f"similar names: {', '.join(near)}"
    more = f" and {len(named) - _SHOWN} more" if len(named) > _SHOWN else ""
    return f"it has {', '.join(named[:_SHOWN])}{more}"


def listed(left_out: Mapping[str, str]) -> str:
    """Return the left-out contents of a file as the end of a sentence, shortened."""
    some = [f"; {name}: {what}" for name, what in left_out.items()][:_LISTED]
    more = len(left_out) - len(some)
    return "".join(some) + (f"; and {more} more" if more else "")


class ArrayTable:
    """Columns of arrays in a file: in memory, mapped, or sliced from the disk.

    Parameters
    ----------
    columns : mapping of str to (length, read)
        Number of rows, and reader of a slice, by column name.
    left_out : mapping of str to str, optional
        See `Table`.
    """

    time: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()

    def __init__(
        self,
        path: Path,
        columns: Mapping[str, tuple[int, Callable[[slice], object]]],
        left_out: Mapping[str, str] | None = None,
    ) -> None:
        self.path = path
        self.names = tuple(columns)
        self.left_out = left_out or {}
        self._columns = tuple(columns.values())

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns of equal length block by block."""
        lengths = {self.names[index]: self._columns[index][0] for index in columns}
        if len(set(lengths.values())) > 1:
            each = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise FileError(
                f"{self.path}: columns must have equal numbers of rows, not {each}; choose columns"
                " of one recording"
            )
        rows = next(iter(lengths.values()))
        size = 8 * min(rows, ROWS) * len(columns)
        refuse_beyond(self.path, size, f"a block of {len(columns)} columns")
        for begin in range(0, rows, ROWS):
            part = slice(begin, begin + ROWS)
            block = [np.asarray(self._columns[index][1](part), dtype=float) for index in columns]
            yield np.stack(block, axis=1)


def position_factor(unit: str, per_unit: float | None) -> float:
    """Return the SI value [rad or m, also per second] of a unit of position or velocity.

    Parameters
    ----------
    unit : str
        A `PositionUnit` or `VelocityUnit`.
    per_unit : float, optional
        Size of a count [rad or m].
    """
    if per_unit is not None:  # only counts need a size
        return per_unit
    return math.pi / 30 if unit == "rpm" else LENGTHS[unit.removesuffix("/s")]
