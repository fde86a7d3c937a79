"""One reader for each format of files; what a file is, its name's ending says."""

from __future__ import annotations

import stat
from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.imports.readers.sound import SoundTable, sound
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.imports.map_file import Format
    from hil.imports.tables import Table

TEXT = (".csv", ".tsv", ".txt", ".dat", ".asc")
BAGS = (".mcap", ".db3", ".bag")
ARRAYS = (".npy", ".npz")
HDF5 = (".h5", ".hdf5", ".hdf")
PARQUET = (".parquet", ".pq")
KNOWN = (*TEXT, ".csv.gz", *ARRAYS, ".mat", *HDF5, *PARQUET, *BAGS)


def open_table(path: Path, layout: Format) -> Table:
    """Open a file of a recording.

    Raises
    ------
    FileError
        It cannot be read, is of no known format, or its package is not installed.
    """
    with sound(path):
        _refuse_unreadable(path)
        return SoundTable(_reader(path)(path, layout))


def _refuse_unreadable(path: Path) -> None:
    with file_errors(path, "read"):
        if path.is_dir() and not (path / "metadata.yaml").exists():
            raise FileError(
                f"{path}: is a folder, and no rosbag2 without its metadata.yaml; name a file"
            )
        if path.is_dir():
            return
        if not stat.S_ISREG(path.stat().st_mode):
            raise FileError(f"{path}: is a pipe or a device, which is read but once; save a file")
        with path.open("rb") as file:
            if not file.read(1):
                raise FileError(f"{path}: is empty; name a file with a recording")


def _reader(path: Path) -> Callable[[Path, Format], Table]:
    """Import a format's reader, and with it what that needs."""
    ending = Path(path.stem).suffix.lower() if path.suffix == ".gz" else path.suffix.lower()
    if path.is_dir() or ending in BAGS:
        from hil.imports.readers.joint_states import open_bag  # noqa: PLC0415

        return open_bag
    if ending in ARRAYS:
        from hil.imports.readers.arrays import open_arrays  # noqa: PLC0415

        return open_arrays
    if ending == ".mat":
        from hil.imports.readers.matlab import open_matlab  # noqa: PLC0415

        return open_matlab
    if ending in HDF5:
        from hil.imports.readers.hdf5 import open_hdf5  # noqa: PLC0415

        return open_hdf5
    if ending in PARQUET:
        from hil.imports.readers.parquet import open_parquet  # noqa: PLC0415

        return open_parquet
    if ending in TEXT:
        from hil.imports.readers.text import open_text  # noqa: PLC0415

        return open_text
    raise FileError(
        f"{path}: {path.suffix or 'no ending'} is no known format; known are {', '.join(KNOWN)},"
        " and folders of rosbag2"
    )
