"""A run as a folder of tables, whatever their format: a file a measurement, and a list of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from hil.export.recordings.origin import NAME, about_columns, readme
from hil.export.recordings.tables import INDEX, columns, row
from hil.runs.atomic_file import new_file, own_folder

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import IO

    from hil.export.recordings.job import Job
    from hil.export.recordings.tables import Column
    from hil.runs.recording_file import Measured

FOLDER = "recordings"
"""Of the tables; the list of them lies beside it."""


class TableFormat(Protocol):
    """How one table gets into a file."""

    ending: str

    def write(self, file: IO[bytes], table: Sequence[Column], job: Job, measured: Measured) -> None:
        """Write the table of a measurement."""

    def write_index(
        self, file: IO[bytes], names: Sequence[str], rows: Sequence[Sequence[Any]], job: Job
    ) -> None:
        """Write the list of measurements."""


def write_tables(job: Job, kind: TableFormat) -> None:
    """Write ``recordings/ID.ending``, ``index.ending`` that lists them, and what each column is."""
    rows: list[Sequence[Any]] = []
    seen: dict[str, Column] = {}
    own_folder(job.folder / FOLDER)
    for measured in job:
        name = f"{FOLDER}/{measured.measurement.id}.{kind.ending}"
        table = columns(job.run.robot, measured)
        with new_file(job.folder / name) as file:
            kind.write(file, table, job, measured)
        rows.append((name, *row(measured)))
        seen = {column.name: column for column in table} | seen
    with new_file(job.folder / f"index.{kind.ending}") as file:
        kind.write_index(file, ("file", *INDEX), rows, job)
    with new_file(job.folder / NAME) as file:
        file.write(readme(job, about_columns(seen.values())).encode())
