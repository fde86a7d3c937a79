"""Files of arrays: NumPy's .npy and .npz, and HDF5.

A .npy is mapped into memory, a .npz unpacked array by array; HDF5 is read from the disk in slices,
a dataset by its path.

The longer side of an array of two dimensions is time; its columns are ``name/1``, ``name/2`` and so
on, ``1``, ``2`` in a .npy. In three dimensions the longest one is time, and columns are
``name/1/1``, ``name/1/2``, as by simulators with a row of position and velocity for each joint.
Dimensions of one element do not count, such as the second of the 6 x 1 x 4000 that Simulink saves
of a vector. Fields of a structured array are columns by their names.
"""

from __future__ import annotations

import math
import zipfile
from itertools import product
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from checked_files.budget import CHECKED, refuse_beyond
from checked_files.yaml_file import FileError
from hil.imports.readers.unpacked import refuse_elsewhere, refuse_inflated_archive
from hil.imports.tables import ROWS, ArrayTable, listed
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from hil.imports.map_file import Format

    Columns = dict[str, tuple[int, Callable[[slice], object]]]


DATASET = 24_000
"""Memory of an open HDF5 dataset with its description [bytes]; by RSS 21 800, for 5000 datasets."""
JOINTS = 300
"""Maximum number of columns of an array of three dimensions: position, velocity and torque of 100
joints; images have more."""
COLUMN = 600
"""Memory of an offered column [bytes]; by RSS 517 for 10^6 columns of a dataset of HDF5."""


def open_arrays(path: Path, _: Format) -> ArrayTable:
    """Open arrays of NumPy; errors are those of `hil.imports.readers.open_table`."""
    left_out: dict[str, str] = {}
    try:
        with file_errors(path, "read"):
            if zipfile.is_zipfile(path):
                refuse_inflated_archive(path)
            loaded = np.load(path, mmap_mode="r", allow_pickle=False)
            if isinstance(loaded, np.ndarray):
                return table_of(path, {"": loaded})
            with loaded:
                arrays = dict(_unpacked(loaded, left_out))
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: is not a NumPy file: {error}") from error
    return table_of(path, arrays, left_out)


def table_of(
    path: Path, arrays: dict[str, Any], left_out: dict[str, str] | None = None
) -> ArrayTable:
    """Make a table of named arrays, or of array-like objects that can be sliced.

    Parameters
    ----------
    left_out : dict of str to str, optional
        Contents without columns, with the reason.

    Raises
    ------
    FileError
        No array is a column of numbers.
    """
    left_out = dict(left_out or {})
    columns: Columns = {}
    for name, array in arrays.items():
        if array.dtype.names:  # HDF5 reads whole rows of a structured array
            size = array.dtype.itemsize * min(len(array), ROWS) if array.shape else 0
            refuse_beyond(path, size, f"a block of {name}")
        for column in _columns(name, array, left_out):
            columns.update([column])
            if len(columns) % CHECKED == 0:
                refuse_beyond(path, COLUMN * len(columns), f"{len(columns)} columns")
    if not columns:
        raise FileError(
            f"{path}: holds no arrays of one or two dimensions with numbers{listed(left_out)}"
        )
    return ArrayTable(path, columns, left_out)


def _no_columns(array: Any) -> str:
    """Describe an array without columns."""
    shape = " x ".join(map(str, array.shape))
    if array.dtype.kind in "fiub":
        return f"an array of {shape} numbers" if array.shape else "a single number"
    return f"an array of {shape} values of type {array.dtype}, not of numbers"


def _unpacked(archive: Any, left_out: dict[str, str]) -> Iterator[tuple[str, np.ndarray]]:
    for name in archive.files:
        try:
            yield name, archive[name]
        except ValueError:
            left_out[name] = "an array of Python objects (not unpickled, for safety)"


def _columns(
    name: str, array: Any, left_out: dict[str, str]
) -> Iterator[tuple[str, tuple[int, Callable[[slice], object]]]]:
    if array.dtype.names:
        for field in array.dtype.names:
            yield from _columns(f"{name}/{field}".lstrip("/"), _Field(array, field), left_out)
        return
    if array.ndim > 2 and sorted(array.shape)[-3] == 1:
        array = _Squeezed(array)
    rows = max(array.shape, default=0)
    deep = array.ndim == 3 and array.shape.count(rows) == 1
    if deep and array.dtype.kind in "fiub" and 0 < math.prod(array.shape) <= JOINTS * rows:
        time = array.shape.index(rows)
        for place in product(*(range(n) for n in array.shape[:time] + array.shape[time + 1 :])):
            words = "/".join(str(index + 1) for index in place)
            yield f"{name}/{words}".lstrip("/"), (rows, _deep_slicer(array, time, place))
        return
    if array.dtype.kind not in "fiub" or not 1 <= array.ndim <= 2 or not all(array.shape):
        left_out[name or "1"] = _no_columns(array)
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


def _deep_slicer(array: Any, time: int, place: tuple[int, ...]) -> Callable[[slice], object]:
    return lambda part: array[(*place[:time], part, *place[time:])]


class _Squeezed:
    """Array without the dimensions of one element, sliced like an array."""

    def __init__(self, array: Any) -> None:
        kept = [k for k, size in enumerate(array.shape) if size != 1] or [0]
        self._array, self._kept = array, kept
        self.dtype, self.shape = array.dtype, tuple(array.shape[k] for k in kept)
        self.ndim = len(kept)

    def __getitem__(self, part: Any) -> Any:
        index: list[Any] = [0] * self._array.ndim
        for dimension, each in zip(
            self._kept, part if isinstance(part, tuple) else (part,), strict=False
        ):
            index[dimension] = each
        return self._array[tuple(index)]


class _Field:
    """Field of a structured array, sliced like an array."""

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
    found: dict[str, Any] = {}

    def take(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            refuse_elsewhere(path, name, item)
            found[name] = item
            refuse_beyond(path, DATASET * len(found), f"{len(found)} datasets")

    hdf5_of(path).visititems(take)
    return table_of(path, found)


def hdf5_of(path: Path) -> h5py.File:
    """Open an HDF5 file for as long as its datasets are in use.

    Raises
    ------
    FileError
        The file is not HDF5, or is damaged.
    """
    try:
        return h5py.File(path, "r")
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(f"{path}: is not an HDF5 file, or is damaged: {reason}") from error
