"""Traces of a scope with separate stamps: below one another, or in groups of columns.

CODESYS exports traces below one another, each with a line ``N.Variable; NAME``, further lines, and
then rows of a time stamp and a value. The columns are `time` and the names if all traces have equal
stamps, else ``NAME/time`` with each ``NAME``.
"""

from __future__ import annotations

import re
from array import array
from typing import TYPE_CHECKING

import numpy as np

from checked_files.budget import allowed, refuse_beyond
from checked_files.foreign_text import one_line
from checked_files.yaml_file import FileError
from hil.imports.tables import ArrayTable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.imports.tables import Table

    Trace = tuple[Array, Array]

TRACE, CHARACTER, SAMPLE = 2000, 9, 18
"""Maximum memory of a trace, of a character of its name, and of a row [bytes].

By tracemalloc: 1750 for 20 000 traces of one row, 8.3 for names in UCS-4, 17.8 for 300 000 rows.
"""
_VARIABLE = re.compile(r"^\s*(\d+)\.Variable\s*;\s*(.*?)\s*$")
_KEY = re.compile(r"^\s*[A-Za-z\[\d][^;]*;")


def is_stacked(head: str) -> bool:
    """Return True if a file starting with `head` holds traces below one another."""
    lines = head.lstrip("\ufeff").splitlines()[:200]
    return bool(lines) and lines[0].startswith("[key]") and any(map(_VARIABLE.match, lines))


class Channels:
    """Table of channels with separate stamps; a row has a single time (see `hil.imports.tables`).

    Parameters
    ----------
    clocks : sequence of int
        Column of the time stamps, for all columns.
    """

    def __init__(self, table: Table, clocks: Sequence[int]) -> None:
        self._table, self._clocks = table, clocks
        self.path, self.names, self.time = table.path, table.names, table.time
        self.left_out, self.notes = table.left_out, table.notes

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns block by block.

        Raises
        ------
        FileError
            A row contains channels sampled at different times.
        """
        clocks, row, n = sorted({self._clocks[each] for each in columns}), 0, len(columns)
        for block in self._table.blocks([*columns, *clocks]):
            apart = np.abs(block[:, n:] - block[:, n : n + 1]) > 0  # False for missing stamps
            if apart.any():
                at, other = np.argwhere(apart)[0]
                stamps = (f"{self.names[clocks[k]]} {block[at, n + k]:g}" for k in (0, other))
                raise FileError(
                    f"{self.path}: row {row + at + 1} has {' and '.join(stamps)}: these channels"
                    " were sampled at different times; export them with one sample time, or"
                    " interpolated, or name columns of one of them"
                )
            yield block[:, :n]
            row += len(block)


def open_stacked(path: Path, lines: Iterable[str]) -> Table:
    """Make a table of traces below one another, from the lines of a text.

    Raises
    ------
    FileError
        A row of a trace is not a time stamp with a value, or no trace has rows.
    """
    rows: dict[str, array[float]] = {}
    name, size, most = "", 0, allowed(path)
    for number, content in enumerate(lines, start=1):
        line = content.lstrip("\ufeff")
        if found := _VARIABLE.match(line):
            name = found[2] or f"trace {found[1]}"
            name = name if name not in rows else f"{name} ({found[1]})"
            rows[name] = array("d")
            size += TRACE + CHARACTER * len(line)
        elif line.strip() and not _KEY.match(line):
            rows[name].extend(_row(path, number, line, name))
            size += SAMPLE
        if size > most:
            refuse_beyond(path, size, f"{len(rows)} traces")
    traces = {name: np.frombuffer(each).reshape(-1, 2) for name, each in rows.items() if each}
    if not traces:
        raise FileError(f"{path}: holds {len(rows)} traces without rows; record them, then export")
    table = ArrayTable(path, {key: _read(column) for key, column in _columns(traces).items()})
    if "time" in table.names:
        return table
    return Channels(table, [column - column % 2 for column in range(len(table.names))])


def _row(path: Path, number: int, line: str, name: str) -> tuple[float, float]:
    cells = [cell.strip().replace(",", ".") for cell in line.split(";")]
    try:
        time, value = (_number(cell) for cell in cells if cell)
    except ValueError:
        raise FileError(
            f"{path}:{number}: '{one_line(line, 40)}' in trace '{one_line(name)}' must be a time"
            " stamp and a number; choose another trace, or remove this one"
        ) from None
    return time, value


def _number(cell: str) -> float:
    """Return a number, or a truth value as written by controllers."""
    truth = {"TRUE": 1.0, "FALSE": 0.0}
    return truth[cell.upper()] if cell.upper() in truth else float(cell)


def _columns(traces: dict[str, Array]) -> dict[str, Array]:
    """Return columns by name, with a single time column if all common stamps are equal."""
    n = min(map(len, traces.values()))
    first = next(iter(traces.values()))[:n, 0]
    if all(np.array_equal(each[:n, 0], first) for each in traces.values()):
        return {"time": first} | {name: each[:n, 1] for name, each in traces.items()}
    found: dict[str, Array] = {}
    for name, each in traces.items():
        found |= {f"{name}/time": each[:, 0], name: each[:, 1]}
    return found


def _read(column: Array) -> tuple[int, Callable[[slice], object]]:
    return len(column), lambda part: column[part]
