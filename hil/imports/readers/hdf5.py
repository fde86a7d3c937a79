"""HDF5: every dataset with numbers, by its path; read from the disk in slices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import h5py

from checked_files.yaml_file import FileError
from hil.imports.readers.arrays import table_of

if TYPE_CHECKING:
    from pathlib import Path

    from hil.imports.map_file import Format
    from hil.imports.tables import ArrayTable


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
