"""Files of arrays: NumPy's .npy and .npz, HDF5, MATLAB before and since 7.3, Parquet.

A .npy is mapped into memory, a .npz unpacked array by array; HDF5 is read from the disk in slices,
a dataset by its path, in MATLAB's files ``data.q``, a field of a structure.

The longer side of an array of two dimensions is time; its columns are ``name/1``, ``name/2`` and so
on, ``1``, ``2`` in a .npy. Fields of a structured array are columns by their names.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from checked_files.budget import refuse_beyond
from checked_files.foreign_text import one_line
from checked_files.yaml_file import FileError
from hil.imports.readers.unpacked import refuse_elsewhere, refuse_inflated_variables
from hil.imports.tables import ROWS, ArrayTable
from hil.optional_packages import needed_for
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.imports.map_file import Format

    Columns = dict[str, tuple[int, Callable[[slice], object]]]


def open_arrays(path: Path, _: Format) -> ArrayTable:
    """Open arrays of NumPy; errors are those of `hil.imports.readers.open_table`."""
    try:
        with file_errors(path, "read"):
            if zipfile.is_zipfile(path):
                with zipfile.ZipFile(path) as archive:
                    size = sum(each.file_size for each in archive.infolist())
                refuse_beyond(path, size, "its arrays")
            loaded = np.load(path, mmap_mode="r", allow_pickle=False)
            if isinstance(loaded, np.ndarray):
                return table_of(path, {"": loaded})
            with loaded:
                arrays = dict(_unpacked(loaded))
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: is no file of NumPy's arrays: {error}") from error
    return table_of(path, arrays)


def table_of(path: Path, arrays: dict[str, Any]) -> ArrayTable:
    """Make a table of named arrays, or what can be sliced like such.

    Raises
    ------
    FileError
        No columns of numbers are among them.
    """
    columns = dict(column for name, array in arrays.items() for column in _columns(name, array))
    if not columns:
        raise FileError(f"{path}: holds no arrays of one or two dimensions with numbers")
    return ArrayTable(path, columns)


def _unpacked(archive: Any) -> Iterator[tuple[str, np.ndarray]]:
    for name in archive.files:
        try:
            yield name, archive[name]
        except ValueError:  # objects, which are never unpickled
            continue


def _columns(name: str, array: Any) -> Iterator[tuple[str, tuple[int, Callable[[slice], object]]]]:
    if array.dtype.names:
        for field in array.dtype.names:
            yield from _columns(f"{name}/{field}".lstrip("/"), _Field(array, field))
        return
    if array.dtype.kind not in "fiub" or not 1 <= array.ndim <= 2 or not all(array.shape):
        return
    if array.ndim == 1 or 1 in array.shape:
        flat = array.ndim == 1
        yield name or "1", (max(array.shape), _slicer(array, None if flat else 0))
        return
    for index in range(min(array.shape)):
        yield f"{name}/{index + 1}".lstrip("/"), (max(array.shape), _slicer(array, index))


def _slicer(array: Any, index: int | None) -> Callable[[slice], object]:
    if index is None:
        return lambda part: array[part]
    if array.shape[0] >= array.shape[1]:
        return lambda part: array[part, index]
    return lambda part: array[index, part]


class _Field:
    """A field of a structured array, sliced like an array."""

    def __init__(self, array: Any, name: str) -> None:
        base = array.dtype[name]
        self._array, self._name = array, name
        self.dtype, self.shape = base.base, (*array.shape, *base.shape)
        self.ndim = len(self.shape)

    def __getitem__(self, part: Any) -> Any:
        if isinstance(part, tuple):
            rows, *rest = part
            return self._array[rows][self._name][(slice(None), *rest)]
        return self._array[part][self._name]


def open_hdf5(path: Path, _: Format) -> ArrayTable:
    """Open a file of HDF5."""
    return table_of(path, datasets_of(path, "/"))


def datasets_of(path: Path, separator: str) -> dict[str, Any]:
    """All datasets, by the names of their groups and their own, joined by `separator`."""
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(f"{path}: is no file of HDF5, or is damaged: {reason}") from error
    found: dict[str, Any] = {}

    def take(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            refuse_elsewhere(path, name, item)
            found[name.replace("/", separator)] = item

    file.visititems(take)
    return found


def open_matlab(path: Path, _: Format) -> ArrayTable:
    """Open a file of MATLAB, before or since 7.3."""
    with file_errors(path, "read"):
        since_7_3 = h5py.is_hdf5(path)
    return table_of(path, datasets_of(path, ".") if since_7_3 else _variables(path))


def _variables(path: Path) -> dict[str, Any]:
    """Variables of a file before 7.3, which a process of its own reads.

    SciPy's reader in C may end on a damaged file, and with it the process that it is in.
    """
    with file_errors(path, "read"):
        with path.open("rb") as file:
            named = any(file.read(20))
        # zeros are variables without a name, which older readers skip one by one for ever
        if not named:
            raise FileError(f"{path}: is no file of MATLAB, or is damaged: it begins with zeros")
        refuse_inflated_variables(path)
        with tempfile.TemporaryFile() as found:
            done = subprocess.run(  # noqa: S603 - our own program
                [sys.executable, "-P", "-c", _MATLAB, str(path.absolute()), str(found.fileno())],
                pass_fds=[found.fileno()],
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode:
                last = (done.stderr.strip().splitlines() or ["its reader ended"])[-1]
                why = one_line(last.partition(": ")[2] or last)
                raise FileError(f"{path}: is no file of MATLAB, or is damaged: {why}")
            found.seek(0)
            with np.load(found, allow_pickle=False) as arrays:
                names = arrays["names"].tolist()
                return {name: arrays[f"arr_{k}"] for k, name in enumerate(names)}


_MATLAB = """
import os, sys
import numpy as np
from scipy.io import loadmat

def flat(values, within):
    for name, value in values.items():
        if isinstance(value, dict):
            yield from flat(value, f"{within}{name}.")
        elif isinstance(value, np.ndarray) and not value.dtype.hasobject:
            yield f"{within}{name}", value

loaded = loadmat(sys.argv[1], simplify_cells=True)
found = dict(flat({k: v for k, v in loaded.items() if not k.startswith("__")}, ""))
with os.fdopen(int(sys.argv[2]), "wb") as out:
    np.savez(out, *found.values(), names=np.array(list(found), dtype=str))
"""
"""Program that reads a file of MATLAB and writes its arrays as a .npz; fields are ``data.q``."""


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
    """Open a file of Parquet."""
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
