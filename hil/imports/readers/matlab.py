"""Files of MATLAB, before version 7.3 and since, in HDF5.

Columns are named as in MATLAB: ``data.q`` is a field of a structure, ``signals(2).values`` a field
of a structure array, ``q{2}`` an element of a cell array, ``data.q/1`` the first column of a
matrix. In structure arrays and cells with more elements than numbers per element, elements are
samples, as written by loops that append: ``log.q/1`` is a column over all of them.

Tables and timetables are read with mat-io if they are variables: ``log.q1``, ``log.Time`` in s, or
ns for a date. Other objects are left out, and tables within structures: their layout is not public.
Also left out are text, functions, and variables without values, for which version 7.3 writes the
size.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import h5py
import numpy as np

from checked_files.budget import allowed, exceeded, refuse_beyond
from checked_files.foreign_text import one_line
from checked_files.yaml_file import FileError
from hil.imports.readers.arrays import DATASET, hdf5_of, table_of
from hil.imports.readers.unpacked import refuse_elsewhere, refuse_inflated_variables
from hil.optional_packages import remedy
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hil.imports.map_file import Format
    from hil.imports.tables import ArrayTable

SEPARATE = 100
"""Maximum number of separately offered elements of a cell or structure array.

Scopes have some inputs each, and a longer draft is not read.
"""
FEWEST = 20
"""Minimum number of rows of a recording in a table: a second of the slowest motion of a robot."""
_TABLES = ("table", "timetable")
_ELEMENT = 5200
"""Bytes of an element of a cell, kept by HDF5 while the file is open; by RSS 5100, for 80 000."""
_SAVED = {
    "table": "writetable({0}, 'FILE.csv')",
    "timetable": "writetimetable({0}, 'FILE.csv')",
    "timeseries": "t = {0}.Time; x = {0}.Data; save('FILE.mat', 't', 'x')",
}
"""Commands to save objects of some classes in a readable form."""
_ELSE = "take its numbers out as arrays, t and x, and save('FILE.mat', 't', 'x')"


def open_matlab(path: Path, _: Format) -> ArrayTable:
    """Open a file of MATLAB; errors are those of `hil.imports.readers.open_table`."""
    with file_errors(path, "read"):
        since_7_3 = h5py.is_hdf5(path)
    if not since_7_3:
        return table_of(path, *_read_apart(path))
    contents = _Contents(path)
    file = hdf5_of(path)
    for name, item in _items(file):
        if not name.startswith("#"):
            contents.add_hdf5(name, item)
    if contents.tables and (size := _size(path, file)) is not None:
        refuse_beyond(path, size, "its tables")
        tables, left_out = _read_apart(path, contents.tables)
        contents.arrays |= tables
        read = {name.partition(".")[0] for name in tables}
        contents.left_out = {k: v for k, v in contents.left_out.items() if k not in read} | left_out
    return table_of(path, contents.arrays, contents.left_out)


def _size(path: Path, file: h5py.File) -> int | None:
    """Return the size of all values of a file [B]; None if a link leads elsewhere."""
    size, groups, known = 0, [file["/"]], set[int]()
    while groups:
        group = groups.pop()
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                return None
            item = group[name]
            address = h5py.h5o.get_info(item.id).addr
            if address in known:
                continue
            known.add(address)
            if isinstance(item, h5py.Group):
                groups.append(item)
            else:
                refuse_elsewhere(path, name, item)
                size += item.nbytes
    return size


def _read_apart(path: Path, tables: Sequence[str] = ()) -> tuple[dict[str, Any], dict[str, str]]:
    """Return arrays and left-out contents of a file, read by another process.

    Readers in C may crash on a damaged file. For version 7.3 this concerns tables only.
    """
    with file_errors(path, "read"):
        with path.open("rb") as file:
            named = any(file.read(20))
        # zeros are unnamed variables, which older readers skip one by one without end
        if not named and not tables:
            raise FileError(f"{path}: is not a MATLAB file, or is damaged: it begins with zeros")
        refuse_inflated_variables(path)
        with tempfile.TemporaryFile() as found:
            arguments = [str(path.absolute()), str(found.fileno()), *tables]
            done = subprocess.run(  # noqa: S603 - our own program
                [sys.executable, "-P", "-m", __name__, *arguments],
                pass_fds=[found.fileno()],
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode:
                last = (done.stderr.strip().splitlines() or ["the reader ended without a message"])[
                    -1
                ]
                if "MemoryError" in last:
                    raise exceeded(path, "reading it")
                why = one_line(last.partition(": ")[2] or last)
                raise FileError(f"{path}: is not a MATLAB file, or is damaged: {why}")
            found.seek(0)
            with np.load(found, allow_pickle=False) as arrays:
                names, left_out = json.loads(str(arrays["contents"]))
                return {name: arrays[f"arr_{k}"] for k, name in enumerate(names)}, left_out


def limit_memory(path: Path) -> None:
    """Bound the additional memory of this process to the budget of a file (on Linux).

    A damaged header makes readers allocate more than any variable of the file needs.
    """
    status = Path("/proc/self/status")
    if not status.is_file():
        return
    import resource  # noqa: PLC0415 - not on every system

    (line,) = [line for line in status.read_text().splitlines() if line.startswith("VmData:")]
    most = 1024 * int(line.split()[1]) + allowed(path)
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def _write_apart(path: Path, descriptor: int, tables: Sequence[str]) -> None:
    """Write the contents of a file as a .npz: main function of the other process."""
    contents = _Contents(path)
    contents.tables.extend(tables)
    import scipy.io  # noqa: F401, PLC0415 - before memory is limited

    if tables:
        with suppress(ModuleNotFoundError):
            import matio  # noqa: F401, PLC0415
    limit_memory(path)
    for name, value in _variables(path) if not tables else ():
        contents.add(name, value)
    contents.add_tables()
    objects = [name for name, array in contents.arrays.items() if np.asarray(array).dtype.hasobject]
    for name in objects:
        contents.left_out[name] = f"an array of {type(contents.arrays.pop(name)).__name__}"
    text = json.dumps([list(contents.arrays), contents.left_out])
    with os.fdopen(descriptor, "wb") as out:
        np.savez(out, *contents.arrays.values(), contents=np.array(text))


def _object(name: str, kind: str) -> str:
    """Describe an object of MATLAB, with the command that saves its numbers."""
    saved = _SAVED.get(kind, _ELSE).format(name)
    return f"a MATLAB {kind}, an object: not supported; in MATLAB run {saved}"


class _Contents:
    """Arrays of numbers in a file, by name, and its left-out contents."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.arrays: dict[str, Any] = {}
        self.left_out: dict[str, str] = {}
        self.tables: list[str] = []
        self._known: set[int] = set()

    def add_tables(self) -> None:
        """Add the columns of tables, if mat-io is installed."""
        found: dict[str, Any] = {}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if self.tables:
                    from matio import load_from_mat  # noqa: PLC0415 - optional

                    found = load_from_mat(str(self._path), variable_names=self.tables)
        except ModuleNotFoundError:
            for name in self.tables:
                words = self.left_out.get(name, _object(name, _TABLES[0]))
                self.left_out[name] = f"{words}; or {remedy('recordings', 'mat-io')}"
        except Exception:  # noqa: S110 - what is not understood stays left out, by its class
            pass
        for name, frame in found.items():
            if not hasattr(frame, "columns"):
                continue
            columns = dict(frame.items())
            if frame.index.dtype.kind in "mM":
                columns = {frame.index.name or "Time": frame.index, **columns}
            if len(frame) < FEWEST:
                self.left_out[name] = (
                    f"a table of MATLAB with {len(frame)} rows, fewer than the {FEWEST} that a"
                    " recording has"
                )
                continue
            self.left_out.pop(name, None)
            for key, column in columns.items():
                self._add_column(f"{name}.{key}", column.to_numpy())

    def _add_column(self, name: str, values: Any) -> None:
        if values.dtype.kind == "m":
            self.arrays[name] = values / np.timedelta64(1, "s")
        elif values.dtype.kind == "M":
            self.arrays[name] = values.astype("datetime64[ns]").astype(np.int64)
        elif values.dtype.kind in "fiub":
            self.arrays[name] = values
        else:
            self.left_out[name] = "a column of a table without numbers"

    def add(self, name: str, value: Any) -> None:
        """Add a variable, field or element as read by scipy, before 7.3."""
        from scipy.io.matlab import MatlabFunction, MatlabOpaque  # noqa: PLC0415 - slow to load

        if isinstance(value, MatlabOpaque):
            self._add_object(name, _decoded(value["s2"].item()))
        elif isinstance(value, MatlabFunction):
            self.left_out[name] = "a function"
        elif not isinstance(value, np.ndarray):
            self.left_out[name] = f"a {type(value).__name__}; save it as full array: full({name})"
        elif value.dtype.names and value.size:
            elements = value.ravel(order="F")
            for field in value.dtype.names:
                fields = [element[field] for element in elements]
                one_by_one = _structures(name, field, len(fields))
                self._add_several(fields, f"{name}.{field}", one_by_one, self.add)
        elif value.dtype == object and value.size:
            self._add_several(list(value.ravel(order="F")), name, _cells(name), self.add)
        elif value.dtype.kind == "U":
            self.left_out[name] = "text"
        else:
            self._add_numbers(name, value)

    def add_hdf5(self, name: str, item: Any) -> None:
        """Add a variable, field or element of version 7.3."""
        size = DATASET * len(self.arrays) + _ELEMENT * len(self.left_out)
        refuse_beyond(self._path, size, f"{len(self.arrays)} variables")
        kind = item.attrs.get("MATLAB_class", b"")
        kind = kind.decode() if isinstance(kind, bytes) else str(kind)
        if item.attrs.get("MATLAB_empty", 0):
            self.left_out[name] = f"empty, a {kind or 'variable'} without values"
        elif "MATLAB_object_decode" in item.attrs:
            self._add_object(name, kind)
        elif self._is_known(item):
            self.left_out[name] = "a second name of the same values"
        elif isinstance(item, h5py.Group):
            for field, value in _items(item):
                if isinstance(value, h5py.Dataset) and value.dtype == h5py.ref_dtype:
                    elements = self._elements(f"{name}.{field}", value)
                    # only cells have a MATLAB class, structure arrays have none
                    if "MATLAB_class" not in value.attrs:
                        one_by_one = _structures(name, field, len(elements))
                    else:
                        one_by_one = _cells(f"{name}.{field}")
                    self._add_several(elements, f"{name}.{field}", one_by_one, self.add_hdf5)
                else:
                    self.add_hdf5(f"{name}.{field}", value)
        elif item.dtype == h5py.ref_dtype:
            self._add_several(self._elements(name, item), name, _cells(name), self.add_hdf5)
        elif kind == "char":
            self.left_out[name] = "text"
        else:
            self._add_numbers(name, item)

    def _is_known(self, item: Any) -> bool:
        """Return True if a group or cell is met again: names could multiply without end."""
        if not isinstance(item, h5py.Group) and item.dtype != h5py.ref_dtype:
            return False
        address = h5py.h5o.get_info(item.id).addr
        known = address in self._known
        self._known.add(address)
        return known

    def _add_object(self, name: str, kind: str) -> None:
        self.left_out[name] = _object(name, kind)
        if kind in _TABLES and name.isidentifier():  # a whole variable, not a part of one
            self.tables.append(name)

    def _add_numbers(self, name: str, array: Any) -> None:
        if isinstance(array, h5py.Dataset):
            refuse_elsewhere(self._path, name, array)
        if array.size == 1:
            self.left_out[name] = "a single number"
        else:
            self.arrays[name] = array

    def _add_several(
        self,
        elements: Sequence[Any],
        together: str,
        one_by_one: Callable[[int], str],
        add: Callable[[str, Any], None],
    ) -> None:
        """Add elements as rows of an array, or separately if elements are not samples."""
        if _are_samples(elements):
            refuse_beyond(self._path, len(elements) * elements[0].nbytes, together)
            self.arrays[together] = np.array([np.ravel(element) for element in elements])
        elif len(elements) > SEPARATE:
            self.left_out[together] = f"{len(elements)} elements that are not arrays of one size"
        else:
            for number, element in enumerate(elements, start=1):
                add(one_by_one(number), element)

    def _elements(self, name: str, references: h5py.Dataset) -> _Elements:
        """Return the targets of a cell's or structure array's references, in MATLAB's order."""
        refuse_beyond(self._path, references.size * _ELEMENT, name)
        refuse_elsewhere(self._path, name, references)
        # a matrix is transposed in HDF5: its rows there are MATLAB's columns
        return _Elements(self._path, name, references)


class _Elements(Sequence[Any]):
    """Targets of references, open while in use: an open target takes about 7 kB."""

    def __init__(self, path: Path, name: str, references: h5py.Dataset) -> None:
        self._path, self._name, self._file = path, name, references.file
        self._references = references[()].ravel()

    def __len__(self) -> int:
        return len(self._references)

    def __getitem__(self, number: Any) -> Any:
        element = self._file[self._references[number]]
        if isinstance(element, h5py.Dataset):
            refuse_elsewhere(self._path, self._name, element)
        return element


def _items(group: h5py.Group) -> Iterator[tuple[str, Any]]:
    """Yield the members of a group without links to other places or files."""
    for name in group:
        if isinstance(group.get(name, getlink=True), h5py.HardLink):
            yield name, group[name]


def _are_samples(elements: Sequence[Any]) -> bool:
    """Return True if elements of equal shape outnumber the values of each element."""
    first = elements[0]
    if not hasattr(first, "shape") or not 0 < first.size < len(elements):
        return False
    return all(
        getattr(each, "shape", None) == first.shape
        and each.dtype.kind in "fiub"
        and "MATLAB_object_decode" not in getattr(each, "attrs", ())
        for each in elements
    )


def _structures(name: str, field: str, n: int) -> Callable[[int], str]:
    """Return a function from the number of a structure, of `n`, to the name of its field."""
    return lambda number: f"{name}({number}).{field}" if n > 1 else f"{name}.{field}"


def _cells(name: str) -> Callable[[int], str]:
    return lambda number: f"{name}{{{number}}}"


def _variables(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield names and values of the variables of a file before 7.3."""
    from scipy.io.matlab import MatReadWarning, loadmat  # noqa: PLC0415 - slow to load

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MatReadWarning)  # all objects are called None
        loaded = loadmat(path)
        objects = list(_objects(path)) if "None" in loaded else []
    yield from ((n, v) for n, v in loaded.items() if not n.startswith("__") and n != "None")
    yield from objects


def _objects(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield names and values of objects, all called None by scipy."""
    from scipy.io.matlab import loadmat, varmats_from_mat  # noqa: PLC0415 - slow to load

    with path.open("rb") as file:
        for name, variable in varmats_from_mat(file):
            if name == "None":
                value = loadmat(cast("Any", variable)).get("None")
                if value is not None:
                    yield _decoded(value["s0"].item()), value


def _decoded(text: object) -> str:
    return text.decode("latin-1") if isinstance(text, bytes) else str(text)


if __name__ == "__main__":
    _write_apart(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
