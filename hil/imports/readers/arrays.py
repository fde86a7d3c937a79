"""Files of arrays: NumPy's .npy and .npz, HDF5, MATLAB before and since 7.3.

A .npy is mapped into memory, a .npz unpacked array by array; HDF5 is read from the disk in slices,
a dataset by its path, in MATLAB's files ``data.q``, a field of a structure.

The longer side of an array of two dimensions is time; its columns are ``name/1``, ``name/2`` and so
on, ``1``, ``2`` in a .npy. Fields of a structured array are columns by their names.
"""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from checked_files.yaml_file import FileError
from hil.imports.tables import ArrayTable
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from hil.imports.map_file import Format

    Columns = dict[str, tuple[int, Callable[[slice], object]]]


def open_arrays(path: Path, _: Format) -> ArrayTable:
    """Open arrays of NumPy.

    Raises
    ------
    FileError
        It is no such file, or holds no columns of numbers.
    """
    try:
        with file_errors(path, "read"):
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
    """Open a file of HDF5.

    Raises
    ------
    FileError
        It is no such file, is damaged, or holds no columns of numbers.
    """
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
            found[name.replace("/", separator)] = item

    file.visititems(take)
    return found


def open_matlab(path: Path, _: Format) -> ArrayTable:
    """Open a file of MATLAB.

    Raises
    ------
    FileError
        It is no such file, or holds no columns of numbers.
    """
    with file_errors(path, "read"):
        since_7_3 = h5py.is_hdf5(path)
    return table_of(path, datasets_of(path, ".") if since_7_3 else _variables(path))


def _variables(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat  # noqa: PLC0415 - needed for nothing else
    from scipy.io.matlab import MatReadError  # noqa: PLC0415

    try:
        with file_errors(path, "read"):
            loaded = loadmat(path, simplify_cells=True)
    except (ValueError, TypeError, NotImplementedError, KeyError, MatReadError) as error:
        raise FileError(f"{path}: is no file of MATLAB, or is damaged: {error}") from error
    return dict(_flat({k: v for k, v in loaded.items() if not k.startswith("__")}, ""))


def _flat(values: dict[str, Any], within: str) -> Iterator[tuple[str, np.ndarray]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{within}{name}.")
        elif isinstance(value, np.ndarray):
            yield f"{within}{name}", value
