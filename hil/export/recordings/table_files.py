"""A run as a folder of tables, as CSV or Parquet: a file a measurement, and a list of them.

CSV has one header line and numbers alone, as PlotJuggler and pandas expect them, with the digits
that give the same double again. A missing sample is an empty cell: PlotJuggler takes a column that
begins with the word nan for text. Parquet has the same tables, each column with its unit and where
it is from, and what is known of the measurement.
"""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.export.recordings.job import README, about_columns, facts, readme
from hil.export.recordings.tables import INDEX, columns, row
from hil.optional_packages import needed_for
from hil.runs.atomic_file import new_file, own_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from typing import IO

    from hil.export.recordings.job import Job
    from hil.export.recordings.tables import Column
    from hil.runs.recording_file import Measured

    Table = Sequence[Column]
    Row = Sequence[Any]

FOLDER = "recordings"
"""Of the tables; the list of them lies beside it."""


def write_csv(job: Job) -> None:
    """Write the tables of a run as CSV."""

    def write(file: IO[bytes], rows: Iterable[Row]) -> None:
        text = io.TextIOWrapper(file, "utf-8", newline="")
        csv.writer(text, lineterminator="\n").writerows(rows)
        text.detach()

    _write_tables(
        job,
        "csv",
        lambda file, table, _: write(file, _rows_of(table)),
        lambda file, names, rows: write(file, [names, *rows]),
    )


def _rows_of(table: Table, at_a_time: int = 1 << 14) -> Iterator[Row]:
    """Names of the columns and their values; few rows at a time are Python's own numbers."""
    yield [column.name for column in table]
    for begin in range(0, len(table[0].values), at_a_time):
        some = [column.values[begin : begin + at_a_time] for column in table]
        yield from zip(
            *(np.where(np.isnan(each), "", each.astype(object)).tolist() for each in some),
            strict=True,
        )


def write_parquet(job: Job) -> None:
    """Write the tables of a run as Parquet.

    Raises
    ------
    FileError
        pyarrow is not installed.
    """
    with needed_for("--to parquet"):
        import pyarrow  # noqa: PLC0415 - optional
        import pyarrow.parquet  # noqa: PLC0415 - optional
    run = facts(job)

    def field(column: Column) -> Any:
        origin = "derived" if column.derived else "recorded"
        stated = {"unit": column.unit, "what": column.what, "origin": origin}
        kind = pyarrow.from_numpy_dtype(column.values.dtype)
        return pyarrow.field(column.name, kind, metadata=stated)

    def write(file: IO[bytes], table: Table, measured: Measured) -> None:
        stated = {key: str(value) for key, value in zip(INDEX, row(measured), strict=True)}
        stated["measurement"] = measured.measurement.model_dump_json()
        schema = pyarrow.schema([field(column) for column in table], metadata=run | stated)
        arrays = [pyarrow.array(column.values) for column in table]
        pyarrow.parquet.write_table(pyarrow.table(arrays, schema=schema), file)

    def write_index(file: IO[bytes], names: Sequence[str], rows: Sequence[Row]) -> None:
        listed = dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))
        pyarrow.parquet.write_table(pyarrow.table(listed, metadata=run), file)

    _write_tables(job, "parquet", write, write_index)


def _write_tables(
    job: Job,
    ending: str,
    write: Callable[[IO[bytes], Table, Measured], None],
    write_index: Callable[[IO[bytes], Sequence[str], Sequence[Row]], None],
) -> None:
    """Write ``recordings/ID.ending``, ``index.ending`` that lists them, and what each column is."""
    rows: list[Row] = []
    seen: dict[str, Column] = {}
    own_folder(job.folder / FOLDER)
    for measured in job:
        name = f"{FOLDER}/{measured.measurement.id}.{ending}"
        table = columns(job.run.robot, measured)
        with new_file(job.folder / name) as file:
            write(file, table, measured)
        rows.append((name, *row(measured)))
        seen = {column.name: column for column in table} | seen
    with new_file(job.folder / f"index.{ending}") as file:
        write_index(file, ("file", *INDEX), rows)
    with new_file(job.folder / README) as file:
        file.write(readme(job, about_columns(seen.values())).encode())
