"""Recordings as CSV: one header line and numbers alone, as PlotJuggler and pandas expect them.

Numbers have the digits that give the same double again. A missing sample is an empty cell:
PlotJuggler takes a column that begins with the word nan for text.
"""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.export.recordings.written_tables import write_tables

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import IO

    from hil.export.recordings.job import Job
    from hil.export.recordings.tables import Column, Values
    from hil.runs.recording_file import Measured

ROWS = 1 << 14
"""Rows that are made at a time."""


def write_csv(job: Job) -> None:
    """Write the tables of a run as CSV."""
    write_tables(job, _Csv())


class _Csv:
    ending = "csv"

    def write(self, file: IO[bytes], table: Sequence[Column], job: Job, measured: Measured) -> None:
        """Write the table of a measurement; CSV has no place for what is known of it."""
        del job, measured
        file.write(f"{','.join(column.name for column in table)}\n".encode())
        for begin in range(0, len(table[0].values), ROWS):
            cells = [_cells(column.values[begin : begin + ROWS]) for column in table]
            lines = map(",".join, zip(*cells, strict=True))
            file.write(("\n".join(lines) + "\n").encode())

    def write_index(
        self, file: IO[bytes], names: Sequence[str], rows: Sequence[Sequence[Any]], job: Job
    ) -> None:
        """Write the list of measurements."""
        del job
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([names, *rows])
        file.write(text.getvalue().encode())


def _cells(values: Values) -> Iterable[str]:
    texts = map(repr, values.tolist())
    if np.isfinite(values).all():
        return texts
    return ["" if text == "nan" else text for text in texts]
