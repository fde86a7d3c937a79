"""Parquet files and JSON Lines: columns of numbers, time stamps, and lists of numbers.

Time stamps become nanoseconds. A JSON object is a row, and a nested object a structure. A list
column, as in data sets of LeRobot, becomes a column per element, ``observation.state/1``; a
structure becomes ``name.field``. Rows with shorter lists have missing numbers.
"""

from __future__ import annotations

import json
import re
from contextlib import suppress
from functools import cached_property
from io import BytesIO
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from checked_files.budget import allowed, refuse_beyond
from checked_files.yaml_file import DEPTH_MAX, FileError
from hil.imports.readers.arrow import numbers
from hil.imports.readers.layout import JOINT_WORDS
from hil.imports.tables import ROWS
from hil.model.robot_file import MOST_JOINTS
from hil.optional_packages import needed_for
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.imports.map_file import Format

    _Keys = tuple[str | None, ...]

LONGEST = 10 * MOST_JOINTS
"""Maximum length of an offered list: ten quantities of every joint; longer lists are images."""
CELL, COLUMN = 32, 3000
"""Maximum memory of a cell and of a column while JSON is read, beside its text [bytes].

By RSS: 11 to 42 with its text of 9 bytes, 15 for a missing cell, 2810 for a column of 20 000
columns.
"""
FOOTER, PLACE, VALUE = 18, 500, 8
"""Maximum memory of a byte of the description of a file, of an offered column, and of a value of a
list, float64; by RSS 2.4 to 10.5 for 10 000 columns, and 254 for 50 000 columns of lists."""
LOOKED_AT = 100
"""Blocks that are searched for the first list of a column, and objects for turns of joints."""
_DOT = re.compile(r"\.")
OBJECT = 1 << 20
"""Maximum length of an object of JSON, a limit of Arrow [characters]."""


class _Place(NamedTuple):
    """Place of a column: name, then fields of structures and elements of lists (from 0)."""

    column: str
    steps: tuple[str | int, ...] = ()

    @property
    def name(self) -> str:
        """Name for the map."""
        within = (f".{each}" if isinstance(each, str) else f"/{each + 1}" for each in self.steps)
        return self.column + "".join(within)

    def within(self, *steps: str | int) -> _Place:
        """Return the place of a field or element in this place."""
        return self._replace(steps=(*self.steps, *steps))


class ParquetTable:
    """Table of Parquet (see `hil.imports.tables.Table`)."""

    time: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()

    def __init__(self, path: Path, file: Any) -> None:
        self.path = path
        self._file = file
        left_out: dict[str, str] = {}
        schema = file.schema_arrow
        plain = dict.fromkeys(map(_Place, schema.names))
        found: dict[_Place, None] = {}
        for number, name in enumerate(schema.names):
            for each in self._found(_Place(name), schema.field(number).type, left_out):
                found[each] = None
                if len(found) % 1000 == 0:
                    refuse_beyond(path, PLACE * len(found), f"{len(found)} columns")
        # numbers count the file's own columns only, not parts of these
        self._places = [*map(_Place, schema.names), *(each for each in found if each not in plain)]
        self._read = found.keys()
        self.names: tuple[str, ...] = tuple(place.name for place in self._places)
        self.left_out: Mapping[str, str] = left_out

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns block by block."""
        places = [self._places[index] for index in columns]
        for place in places:
            self._refuse_no_numbers(place)
        names = list(dict.fromkeys(place.column for place in places))
        for batch in self._file.iter_batches(ROWS, columns=names):
            yield np.stack([_numbers(batch.column(p.column), p) for p in places], axis=1)

    def _refuse_no_numbers(self, place: _Place) -> None:
        if place in self._read:
            return
        kind = self._file.schema_arrow.field(place.column).type
        parts = [each.name for each in self._places if each.column == place.column][1:]
        remedy = f"name one of {parts[0]} to {parts[-1]}" if parts else "choose another column"
        raise FileError(f"{self.path}: column {place.name} holds {kind}, not numbers; {remedy}")

    def _found(
        self, place: _Place, kind: Any, left_out: dict[str, str], most: int = LONGEST
    ) -> Iterator[_Place]:
        """Yield the numeric columns in a column, with at most `most` elements per list."""
        from pyarrow import types  # noqa: PLC0415 - optional

        if types.is_struct(kind):
            for field in kind:
                yield from self._found(place.within(field.name), field.type, left_out, most)
        elif _is_list(kind) and (_is_number(kind.value_type) or types.is_nested(kind.value_type)):
            n = kind.list_size if types.is_fixed_size_list(kind) else self._length(place)
            if (size := VALUE * self._file.most_values(place.column)) > allowed(self.path):
                left_out[place.name] = f"lists of {size // VALUE} numbers in a group of rows"
            elif not 0 < n <= most:
                left_out[place.name] = f"lists of {n} numbers; only lists of 1 to {most} are read"
            elif n == 1 and _is_number(kind.value_type):
                yield place
            else:
                for k in range(n):
                    yield from self._found(place.within(k), kind.value_type, left_out, most // n)
        elif _is_number(kind):
            yield place
        elif types.is_map(kind) and not place.steps:
            left_out[place.name] = (
                f"a column of {kind}, not of numbers; make a column of each key, as by pandas: "
                f"d = pandas.read_parquet({self.path.name!r}); keys = pandas.DataFrame([dict(each) "
                f"for each in d.pop({place.name!r})]).add_prefix({place.name + '.'!r}); "
                "d.join(keys).to_parquet('keys.parquet')"
            )
        else:
            left_out[place.name] = f"a column of {kind}, not of numbers; save it as numbers"

    def _length(self, place: _Place) -> int:
        """Return the length of the first present list of a column; 0 if there is none."""
        import pyarrow.compute as pc  # noqa: PLC0415 - optional

        if VALUE * self._file.most_values(place.column) > allowed(self.path):
            return 0
        for batch in islice(self._file.iter_batches(ROWS, columns=[place.column]), LOOKED_AT):
            lengths = pc.list_value_length(_within(batch.column(place.column), place)).drop_null()
            if len(lengths):
                return int(lengths[0].as_py())
        return 0


def open_parquet(path: Path, _: Format) -> ParquetTable:
    """Open a file of Parquet."""
    with needed_for(path):
        from pyarrow import ArrowException  # noqa: PLC0415 - optional
        from pyarrow.parquet import ParquetFile  # noqa: PLC0415
    try:
        with file_errors(path, "read"):
            with path.open("rb") as raw:
                raw.seek(max(0, path.stat().st_size - 8))
                length = int.from_bytes(raw.read(4), "little")
            refuse_beyond(path, FOOTER * min(length, path.stat().st_size), "its description")
            return ParquetTable(path, _Groups(ParquetFile(path, memory_map=True)))
    except ArrowException as error:
        raise FileError(f"{path}: is not a Parquet file, or is damaged: {error}") from error


class _Groups:
    """Rows of Parquet in groups."""

    def __init__(self, file: Any) -> None:
        self.schema_arrow, self._file, self._about = file.schema_arrow, file, file.metadata

    def iter_batches(self, rows: int, columns: Sequence[str]) -> Iterator[Any]:
        """Yield the rows of some columns in batches, without texts, which may repeat unbounded."""
        leaves = [each for name in columns for each in self._leaves[name]]
        yield from self._file.iter_batches(rows, columns=leaves)

    @cached_property
    def _leaves(self) -> dict[str, list[str]]:
        """Paths of all numbers in a column."""
        found: dict[str, list[str]] = {name: [] for name in self.schema_arrow.names}
        texts: set[str] = set()
        for number in range(self._about.num_columns):
            leaf = self._about.schema.column(number)
            path = f"{leaf.path}."
            names = [path[: end.start()] for end in _DOT.finditer(path)]
            if "BYTE_ARRAY" in leaf.physical_type and leaf.logical_type.type != "FLOAT16":
                texts.update(names)
                continue
            for name in found.keys() & names:
                found[name].append(leaf.path)
        # Arrow reads all that a path leads to, also in a column whose own name has a dot
        if both := texts.intersection(chain.from_iterable(found.values())):
            raise ValueError(f"two columns are named {min(both)}")
        return found

    def most_values(self, column: str) -> int:
        """Return the largest number of values of a column in a group, which may be read at once."""
        return self._most.get(column, 0)

    @cached_property
    def _most(self) -> dict[str, int]:
        found = dict.fromkeys(self.schema_arrow.names, 0)
        for group in range(self._about.num_row_groups):
            columns = self._about.row_group(group)
            for number in range(self._about.num_columns):
                part = columns.column(number)
                path = f"{part.path_in_schema}."
                for end in _DOT.finditer(path):  # a dot may also be within the name of a column
                    if (name := path[: end.start()]) in found:
                        found[name] = max(found[name], part.num_values)
        return found


class _Lines:
    """Rows of JSON, with the interface of a file of Parquet."""

    def __init__(self, table: Any) -> None:
        self._table, self.schema_arrow = table, table.schema

    def most_values(self, _: str) -> int:
        """Return 0: all values are in memory already."""
        return 0

    def iter_batches(self, rows: int, columns: Sequence[str]) -> Iterator[Any]:
        """Yield the rows of some columns in batches."""
        yield from self._table.select(columns).to_batches(rows)


def open_json(path: Path, _: Format) -> ParquetTable:
    """Open objects of JSON, on separate lines or in a single list, or an object of columns."""
    with needed_for(path):
        from pyarrow import ArrowException  # noqa: PLC0415 - optional
        from pyarrow.json import read_json  # noqa: PLC0415
    try:
        with file_errors(path, "read"):
            table = read_json(_lines(path, path.read_text(encoding="utf-8")) or path)
        for number, name in enumerate(table.column_names):
            with suppress(ArrowException):  # numbers as strings, as by some message queues
                kind = _numeric(table.schema.types[number])
                table = table.set_column(number, name, table.column(number).cast(kind))
    except (ArrowException, ValueError, AttributeError, RecursionError) as error:
        raise FileError(
            f"{path}: is neither a JSON list of objects nor JSON lines, one object per sample: "
            f"{error}"
        ) from error
    _refuse_turns(path, table)
    return ParquetTable(path, _Lines(table))


def _refuse_turns(path: Path, table: Any) -> None:
    """Refuse a long layout: a joint in each object."""
    for name in table.column_names:
        seen = table.column(name).slice(0, LOOKED_AT).to_pylist()
        numbered = JOINT_WORDS.intersection(re.findall("[a-z]+", name.lower()))
        joints = list(dict.fromkeys(seen)) if numbered else []
        turns = all(x == joints[k % len(joints)] for k, x in enumerate(seen)) if joints else False
        if turns and 2 <= len(joints) <= len(seen) / 3:
            raise FileError(
                f"{path}: is in a long layout: each object is of one of {joints} in turn, in "
                f"{name}; make a row of each turn, as by pandas: d = pandas.json_normalize("
                f"pandas.read_json({path.name!r}, lines={path.suffix != '.json'}).to_dict("
                f"'records')); d['row'] = (d[{name!r}] == d[{name!r}][0]).cumsum(); d = d.pivot("
                f"index='row', columns={name!r}); d.columns = ['_'.join(map(str, c)) for c in "
                "d.columns]; d.to_csv('wide.csv')"
            )


def _lines(path: Path, text: str) -> BytesIO | None:
    """Return the objects of a list of JSON as lines; None for a file of lines.

    A single object of equally long lists holds columns, whose samples are returned.
    """
    listed = text.lstrip().startswith("[")
    decoder, lines = json.JSONDecoder(parse_constant=lambda _: None), BytesIO()
    row: dict[str, object] = {}
    counted, most, at = _Cells(), allowed(path), text.find("[") + 1 if listed else 0
    while at < len(text):
        if text[at] in " \t\r\n" or (listed and text[at] in ",]"):
            at += 1
            continue
        row, at = _object_at(decoder, text, at)
        counted.add(row)
        if counted.size > most:
            refuse_beyond(path, counted.size, f"{counted.n_columns} columns")
        if listed:
            lines.write(json.dumps(row).encode() + b"\n")
    columns = {name: x for name, x in row.items() if isinstance(x, list)} if counted.n == 1 else {}
    longest = max(map(len, columns.values()), default=0)
    columns = {name: x for name, x in columns.items() if len(x) == longest}
    if not listed and longest > 1 and len(columns) > 1:
        size = longest * (CELL * len(columns) + sum(map(len, columns)))
        refuse_beyond(path, size, f"{longest} samples")
        for values in zip(*columns.values(), strict=True):
            lines.write(json.dumps(dict(zip(columns, values, strict=True))).encode() + b"\n")
    listed |= lines.tell() > 0
    lines.seek(0)
    return lines if listed else None


def _object_at(decoder: json.JSONDecoder, text: str, begin: int) -> tuple[Any, int]:
    """Return an object and the place of its end; text far beyond is not parsed."""
    length = 1 << 12
    while True:
        try:
            found, end = decoder.raw_decode(text[begin : begin + length])
        except json.JSONDecodeError as error:
            if length >= OBJECT or begin + length >= len(text):
                what = f"{error.msg}, of at most {OBJECT} characters per object"
                raise json.JSONDecodeError(what, text, begin + error.pos) from None
            length *= 4
        else:
            return found, begin + end


class _Cells:
    """Count of the cells of a table of objects, including the missing ones."""

    def __init__(self) -> None:
        self._slots: dict[_Keys, int] = {(): 0}
        self._names: dict[_Keys, set[str]] = {}
        self.n_columns = 0

    @property
    def n(self) -> int:
        """Number of objects."""
        return self._slots[()]

    @property
    def size(self) -> int:
        """Memory of the table [bytes]."""
        cells = sum(self._count(place) * len(names) for place, names in self._names.items())
        return CELL * cells + COLUMN * self.n_columns

    def add(self, row: object) -> None:
        """Count an object."""
        if not isinstance(row, dict):
            raise ValueError(f"holds {type(row).__name__} instead of an object")  # noqa: TRY004
        self._slots[()] += 1
        self._within((), row)

    def _count(self, place: _Keys) -> int:
        """Return the number of rows of a structure: those of the table or of the list around."""
        while place not in self._slots:
            place = place[:-1]
        return self._slots[place]

    def _within(self, place: _Keys, value: object) -> None:
        if len(place) > DEPTH_MAX:
            raise ValueError(f"nested deeper than {DEPTH_MAX} levels")
        if isinstance(value, dict):
            names = self._names.setdefault(place, set())
            self.n_columns += len(value.keys() - names)
            names.update(value)
            for name, each in value.items():
                if isinstance(each, dict | list):
                    self._within((*place, name), each)
        elif isinstance(value, list):
            place = (*place, None)
            self._slots[place] = self._slots.get(place, 0) + len(value)
            for each in value:
                if isinstance(each, dict | list):
                    self._within(place, each)


def _is_list(kind: Any) -> bool:
    from pyarrow import types  # noqa: PLC0415 - optional

    return any(
        check(kind) for check in (types.is_list, types.is_large_list, types.is_fixed_size_list)
    )


def _is_number(kind: Any) -> bool:
    from pyarrow import types  # noqa: PLC0415 - optional

    known = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal)
    return any(check(kind) for check in (*known, types.is_timestamp))


def _numeric(kind: Any) -> Any:
    """Return a type of Arrow with numbers in place of text."""
    import pyarrow as pa  # noqa: PLC0415 - optional

    if pa.types.is_struct(kind):
        return pa.struct([(field.name, _numeric(field.type)) for field in kind])
    if pa.types.is_list(kind):
        return pa.list_(_numeric(kind.value_type))
    return pa.float64() if pa.types.is_string(kind) else kind


def _within(column: Any, place: _Place) -> Any:
    """Return the values of a column, or of a field or element within."""
    for step in place.steps:
        column = _elements(column, step) if isinstance(step, int) else _field(column, step)
    return column


def _field(structures: Any, name: str) -> Any:
    import pyarrow.compute as pc  # noqa: PLC0415 - optional

    return pc.struct_field(structures, name)


def _numbers(column: Any, place: _Place) -> Array:
    import pyarrow as pa  # noqa: PLC0415 - optional

    column = _within(column, place)
    if _is_list(column.type):
        column = _elements(column, 0)
    if pa.types.is_timestamp(column.type):
        column = column.cast(pa.timestamp("ns")).cast(pa.int64())
    doubles = column.type == pa.float64()  # whose cast would import `pyarrow.compute`
    return numbers(column if doubles else column.cast(pa.float64(), safe=False))


def _elements(lists: Any, element: int) -> Any:
    """Return an element of all lists; missing if a list is too short or missing."""
    import pyarrow as pa  # noqa: PLC0415 - optional
    import pyarrow.compute as pc  # noqa: PLC0415 - optional

    lengths = pc.list_value_length(lists).fill_null(0).to_numpy(zero_copy_only=False)
    long = lengths > element
    starts = np.cumsum(lengths) - lengths + element
    at = pa.array(np.where(long, starts, 0), mask=~long)
    return lists.flatten().take(at)
