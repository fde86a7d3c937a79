"""MATLAB's files, of versions before and since 7.3; ``data.q`` is a field of a structure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from checked_files.yaml_file import FileError
from hil.imports.readers.arrays import table_of
from hil.imports.readers.hdf5 import datasets_of
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from hil.imports.map_file import Format
    from hil.imports.tables import ArrayTable


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
