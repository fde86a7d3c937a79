"""Parquet: columns of numbers and of instants, read batch by batch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from checked_files.yaml_file import FileError
from hil.imports.tables import ROWS
from hil.optional_packages import needed_for
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.imports.map_file import Format


class ParquetTable:
    """A table of Parquet; see `hil.imports.tables.Table`. Instants become nanoseconds."""

    time: tuple[int, ...] = ()

    def __init__(self, path: Path, file: Any) -> None:
        self.path = path
        self._file = file
        self.names: tuple[str, ...] = tuple(file.schema_arrow.names)

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns block by block."""
        names = [self.names[index] for index in columns]
        for name in names:
            self._refuse_no_numbers(name)
        for batch in self._file.iter_batches(ROWS, columns=list(dict.fromkeys(names))):
            yield np.stack([_numbers(batch.column(name)) for name in names], axis=1)

    def _refuse_no_numbers(self, name: str) -> None:
        from pyarrow import types  # noqa: PLC0415 - optional

        kind = self._file.schema_arrow.field(name).type
        known = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal)
        if not any(check(kind) for check in (*known, types.is_timestamp)):
            raise FileError(
                f"{self.path}: column {name} holds {kind}, not numbers; choose another column"
            )


def open_parquet(path: Path, _: Format) -> ParquetTable:
    """Open a file of Parquet.

    Raises
    ------
    FileError
        It is no such file, or pyarrow is not installed.
    """
    with needed_for(path):
        from pyarrow import ArrowException  # noqa: PLC0415 - optional
        from pyarrow.parquet import ParquetFile  # noqa: PLC0415
    try:
        with file_errors(path, "read"):
            return ParquetTable(path, ParquetFile(path, memory_map=True))
    except ArrowException as error:
        raise FileError(f"{path}: is no file of Parquet, or is damaged: {error}") from error


def _numbers(column: Any) -> Array:
    import pyarrow as pa  # noqa: PLC0415 - optional

    if pa.types.is_timestamp(column.type):
        column = column.cast(pa.timestamp("ns")).cast(pa.int64())
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False))
