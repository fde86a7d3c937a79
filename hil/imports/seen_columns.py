"""What is seen of the columns of a file in its first rows: names, extremes, whether they rise."""

from __future__ import annotations

import json
import re
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.imports.tables import Table


ROWS = 100_000
"""Rows that are looked at, about."""


@dataclass(frozen=True)
class SeenColumn:
    """A column as it looks: its number from 1, name, and the extremes of its values."""

    number: int
    name: str
    low: float
    high: float
    rises: bool
    step: float

    @property
    def key(self) -> str:
        """Name or number as a map states it."""
        return json.dumps(self.name) if self.name else str(self.number)


def look(table: Table) -> tuple[list[SeenColumn], int]:
    """Columns of numbers, and how many rows of them were read."""
    every = list(range(len(table.names)))
    try:
        values = _first_rows(table, every)
        columns = dict(zip(every, values.T, strict=True))
    except FileError:  # text in a column, or lengths that differ: column by column
        columns = {}
        for index in every:
            with suppress(FileError):
                columns[index] = _first_rows(table, [index])[:, 0]
    seen = [_seen(index, table.names[index], values) for index, values in columns.items()]
    return [s for s in seen if s is not None], max(map(len, columns.values()), default=0)


def _first_rows(table: Table, columns: Sequence[int]) -> Array:
    blocks, n = [np.empty((0, len(columns)))], 0
    for block in table.blocks(columns):
        blocks.append(block)
        n += len(block)
        if n >= ROWS:
            break
    return np.concatenate(blocks)


def _seen(index: int, name: str, values: Array) -> SeenColumn | None:
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    steps = np.diff(values)
    rises = bool(len(steps) and np.all(steps >= 0) and values[-1] > values[0])
    step = (values[-1] - values[0]) / max(1, len(steps))
    extremes = float(values.min()), float(values.max())
    return SeenColumn(index + 1, name, *extremes, rises, float(step))


def described(column: SeenColumn) -> str:
    """What a comment says of a column."""
    name = f" {plain(column.name)}" if column.name else ""
    rising = ", rising" if column.rises else ""
    return f"{column.number}{name}: {column.low:.6g} to {column.high:.6g}{rising}"


def plain(text: str) -> str:
    """Text as it may stand in a comment or a mark, whatever a file calls its columns."""
    return " ".join(re.sub(r"[^\x21-\x39\x3b-\x7e\xa1-\uffff]|#", " ", text).split())


def words_of(name: str) -> list[str]:
    """Words and numbers of a name, in small letters."""
    return [word.lower() for word in re.findall(r"[A-Za-z]+|\d+", name)]
