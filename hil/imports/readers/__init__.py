"""Readers of all file formats, chosen by the ending of the file's name.

Any error inside a file, from any library, means that the file is damaged.
"""

from __future__ import annotations

import stat
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, cast

from checked_files.budget import allowed, refuse_beyond
from checked_files.errors import HilError
from checked_files.foreign_text import whole_line
from checked_files.yaml_file import FileError
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from hil.arrays import Array
    from hil.imports.map_file import Format
    from hil.imports.tables import Table

TEXT = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm", ".log")
BAGS = (".mcap", ".db3", ".bag")
ARRAYS = (".npy", ".npz")
HDF5 = (".h5", ".hdf5", ".hdf")
PARQUET = (".parquet", ".pq")
JSON = (".jsonl", ".ndjson", ".json")
KNOWN = (*TEXT, ".csv.gz", ".xml", *JSON, *ARRAYS, ".mat", *HDF5, *PARQUET, *BAGS)
_READERS = (
    (BAGS, "joint_states", "JointStates"),
    (ARRAYS, "arrays", "open_arrays"),
    ((".mat",), "matlab", "open_matlab"),
    (HDF5, "arrays", "open_hdf5"),
    (PARQUET, "parquet", "open_parquet"),
    (JSON, "parquet", "open_json"),
    ((".xml",), "xml_rows", "open_xml"),
    (TEXT, "text", "open_text"),
    ((".r64", ".r32", ".i16", ".i32"), "diadem", "open_values"),
)
"""Endings, with module and function of the reader."""
_SAVE_AS = {
    (".xls", ".xlsx", ".ods"): "save the sheet as CSV",
    (".tdms",): "save it by nptdms: TdmsFile.read(path).as_dataframe().to_parquet(...)",
    (".mf4", ".mdf"): "save it by asammdf: MDF(path).to_dataframe(raster=...).to_parquet(...)",
    (".pkl", ".pickle"): "save the data frame by to_parquet(...); a pickle may run any code",
    (".feather", ".arrow"): "save the data frame by to_parquet(...)",
    (".trc", ".blf"): "frames of CAN are not decoded; record with hil run",
}
"""Unsupported formats, and how to save their data in a supported format."""


def open_table(path: Path, layout: Format) -> SoundTable:
    """Open a file of a recording.

    Raises
    ------
    FileError
        The file cannot be read, its format is unknown, or the format's package is not installed.
    """
    with sound(path):
        path = _sole_bag(path)
        _refuse_unreadable(path)
        return SoundTable(_reader(path)(path, layout))


def _sole_bag(path: Path) -> Path:
    """Return the only bag in a folder without metadata.yaml, as left by a killed recorder."""
    if not path.is_dir() or (path / "metadata.yaml").exists():
        return path
    bags = sorted(each for each in path.iterdir() if each.suffix in BAGS)
    if len(bags) > 1:
        names = ", ".join(str(path / each.name) for each in bags)
        raise FileError(
            f"{path}: is a rosbag2 folder without metadata.yaml (recorder killed?); name its "
            f"files in order: {names}"
        )
    return bags[0] if bags else path


def _refuse_unreadable(path: Path) -> None:
    with file_errors(path, "read"):
        if path.is_dir() and not (path / "metadata.yaml").exists():
            raise FileError(
                f"{path}: is a folder without the metadata.yaml of rosbag2; name a file"
            )
        if path.is_dir():
            return
        if not stat.S_ISREG(path.stat().st_mode):
            raise FileError(f"{path}: is a pipe or a device, not a file; save its data to a file")
        with path.open("rb") as file:
            if not file.read(1):
                raise FileError(
                    f"{path}: is empty (0 bytes); copy or download it again, or name a file with a"
                    " recording"
                )


def _is_text(path: Path) -> bool:
    """Return True for a file that begins with numbers as text."""
    try:
        with path.open("rb") as file:
            head = file.read(1 << 10)
    except OSError:
        return False
    return head.isascii() and b"\0" not in head and any(map(str.isdigit, head.decode()))


def _reader(path: Path) -> Callable[[Path, Format], Table]:
    """Import the reader of a format with its dependencies."""
    ending = Path(path.stem).suffix.lower() if path.suffix == ".gz" else path.suffix.lower()
    for endings, module, function in _READERS:
        if ending in endings or (path.is_dir() and endings is BAGS):
            reader = getattr(import_module(f"hil.imports.readers.{module}"), function)
            return cast("Callable[[Path, Format], Table]", reader)
    remedy = next((f"; {how}" for endings, how in _SAVE_AS.items() if ending in endings), "")
    if not remedy and _is_text(path):
        remedy = "; it holds rows of text: rename it to end in .txt"
    raise FileError(
        f"{path}: {path.suffix or 'no ending'} is an unknown format{remedy}; known:"
        f" {', '.join(KNOWN)}, and rosbag2 folders"
    )


@contextmanager
def sound(path: Path) -> Iterator[None]:
    """Raise any error of a reader as a `FileError` that names the file."""
    try:
        yield
    except HilError as error:
        raise type(error)(whole_line(str(error))) from error
    except Exception as error:
        # a library's message is truncated after 120 characters
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise FileError(
            f"{path}: cannot be read: {reason}; it seems damaged: copy or download it again"
        ) from error


class SoundTable:
    """Table with all errors as `FileError` (see `hil.imports.tables.Table`)."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self.path, self.time = table.path, table.time
        self.names = tuple(map(whole_line, table.names))
        self.left_out: Mapping[str, str] = {
            whole_line(name): whole_line(what) for name, what in table.left_out.items()
        }
        self.notes = tuple(map(whole_line, table.notes))

    @property
    def headers(self) -> tuple[int, ...]:
        """Rows, from 0, of repeated headers, once all blocks are read."""
        return tuple(getattr(self._table, "headers", ()))

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns block by block."""
        with sound(self.path):
            size, most = 0, allowed(self.path)
            for block in self._table.blocks(columns):
                size += block.nbytes
                if size > most:
                    refuse_beyond(self.path, size, "the part read so far")
                yield block
