"""A file of a recording, as columns of numbers that are read in blocks of rows.

Readers (`hil.imports.readers`) make these; nothing else knows in which format a recording came.
"""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, Protocol

import numpy as np

from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.imports.units import TimeUnit


ROWS = 1 << 16
"""Rows of a block, about."""
STAMP_UNITS: tuple[TimeUnit, TimeUnit] = ("s", "ns")
"""Of the two columns of stamps that a format itself has."""
_SHOWN = 12


class NoColumn(Exception):
    """No column of a table has this name or number; the message states which there are."""


class Table(Protocol):
    """A file of a recording.

    Attributes
    ----------
    path : Path
    names : tuple of str
        Of all columns; empty where a column has none.
    time : tuple of int
        Columns whose sum is the time stamp, in `STAMP_UNITS`, where the format itself has stamps.
    """

    path: Path
    names: tuple[str, ...]
    time: tuple[int, ...]

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read these columns (from 0), block by block: arrays (n, len(columns)); NaN is missing.

        Raises
        ------
        FileError
            The file cannot be read, or holds something else than numbers there.
        """
        ...


def column_of(table: Table, column: int | str) -> int:
    """Index, from 0, of a column stated by its number from 1 or by its name.

    Raises
    ------
    NoColumn
        There is none.
    """
    if isinstance(column, int):
        if column <= len(table.names):
            return column - 1
        raise NoColumn(f"{table.path} has {len(table.names)} columns, none of number {column}")
    found = [index for index, name in enumerate(table.names) if name == column]
    if len(found) == 1:
        return found[0]
    if found:
        numbers = " and ".join(str(index + 1) for index in found)
        raise NoColumn(f"{table.path} has {column!r} as columns {numbers}; give a number")
    raise NoColumn(f"{table.path} has no column {column!r}; {_offered(table.names, column)}")


def _offered(names: Sequence[str], wanted: str) -> str:
    named = [name for name in names if name]
    if not named:
        return f"its {len(names)} columns have no names: give numbers from 1"
    near = difflib.get_close_matches(wanted, named, n=3, cutoff=0.5)
    if near:
        return f"near to it: {', '.join(near)}"
    more = f" and {len(named) - _SHOWN} more" if len(named) > _SHOWN else ""
    return f"it has {', '.join(named[:_SHOWN])}{more}"


class ArrayTable:
    """Columns of arrays that lie in one file: in memory, mapped, or sliced from the disk.

    Parameters
    ----------
    path : Path
    columns : mapping of str to (length, read)
        Of each column its number of rows, and what reads a slice of them.
    """

    time: tuple[int, ...] = ()

    def __init__(
        self, path: Path, columns: Mapping[str, tuple[int, Callable[[slice], object]]]
    ) -> None:
        self.path = path
        self.names = tuple(columns)
        self._columns = tuple(columns.values())

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns block by block; they must be of one length."""
        lengths = {self.names[index]: self._columns[index][0] for index in columns}
        if len(set(lengths.values())) > 1:
            each = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise FileError(
                f"{self.path}: columns must have equal numbers of rows, not {each}; choose columns"
                " of one recording"
            )
        for begin in range(0, next(iter(lengths.values())), ROWS):
            part = slice(begin, begin + ROWS)
            block = [np.asarray(self._columns[index][1](part), dtype=float) for index in columns]
            yield np.stack(block, axis=1)
