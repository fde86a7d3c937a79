"""Recordings as Parquet: the tables of the CSV, each column with its unit and where it is from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.export.recordings.origin import facts
from hil.export.recordings.tables import INDEX, row
from hil.export.recordings.written_tables import write_tables
from hil.optional_packages import needed_for

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import IO

    from hil.export.recordings.job import Job
    from hil.export.recordings.tables import Column
    from hil.runs.recording_file import Measured


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
    write_tables(job, _Parquet(pyarrow))


class _Parquet:
    ending = "parquet"

    def __init__(self, pyarrow: Any) -> None:
        self._pyarrow = pyarrow

    def write(self, file: IO[bytes], table: Sequence[Column], job: Job, measured: Measured) -> None:
        """Write the table of a measurement, and with it what is known of it."""
        stated = {key: str(value) for key, value in zip(INDEX, row(measured), strict=True)}
        stated["measurement"] = measured.measurement.model_dump_json()
        schema = self._pyarrow.schema(
            [self._field(column) for column in table], metadata=facts(job) | stated
        )
        arrays = [self._pyarrow.array(column.values) for column in table]
        self._write(file, self._pyarrow.table(arrays, schema=schema))

    def write_index(
        self, file: IO[bytes], names: Sequence[str], rows: Sequence[Sequence[Any]], job: Job
    ) -> None:
        """Write the list of measurements."""
        listed = dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))
        self._write(file, self._pyarrow.table(listed, metadata=facts(job)))

    def _field(self, column: Column) -> Any:
        stated = {
            "unit": column.unit,
            "what": column.what,
            "origin": "derived" if column.derived else "recorded",
        }
        kind = self._pyarrow.from_numpy_dtype(column.values.dtype)
        return self._pyarrow.field(column.name, kind, metadata=stated)

    def _write(self, file: IO[bytes], table: Any) -> None:
        self._pyarrow.parquet.write_table(table, file)
