"""Samples of a recording chosen by a map, in SI and on the joint side, on the disk.

A recording of any length passes through memory block by block; the result is a mapped file, deleted
at the end of the import.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError
from hil.imports.column_names import is_time
from hil.imports.readers import open_table
from hil.imports.signs import (
    coding_of,
    could_lack_signs,
    jumps,
    range_of,
    register_turn,
    turn_of,
    unwrap,
)
from hil.imports.tables import SECONDS, NoColumn, column_of, units_of_date
from hil.imports.to_si import EPOCH, Conversion

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.arrays import Array, Integers, Mask
    from hil.imports.map_file import ColumnName, MapFile
    from hil.imports.readers import SoundTable
    from hil.imports.tables import Table
    from hil.model.robot import Robot

    Location = tuple[str | int, ...]


IN_CACHE = 1 << 12
"""Rows converted at a time: 0.7 MB for twenty columns, which fit a second-level cache."""


WHOLE = 1e-3
"""Error of a whole number of 40 bits after conversion to SI and back, at most."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples as recorded, row by row.

    Attributes
    ----------
    time : array (n,)
        Stamps [s]; dates are relative to the first stamp.
    values : array (n, 3 n_joints)
        Positions, torques and velocities of all joints, SI, joint side, on the disk; NaN for
        missing values, and for all velocities if none were recorded.
    complete : array (n,) of bool
        Rows without missing recorded values.
    begins : tuple of int
        First row of each file.
    restarts : tuple of int
        Rows that repeat the header of a file.
    from_date : bool
        True if stamps count from a date.
    wraps : int
        Number of position steps above half a turn: angles wrapped to one turn.
    numbers : tuple of int
        Count of numbers in each column of the map, in the order of `columns_of`.
    notes : tuple of str
        Notes on files as a whole.
    """

    time: Array
    values: Array
    complete: Mask
    begins: tuple[int, ...]
    from_date: bool
    wraps: int = 0
    numbers: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    restarts: tuple[int, ...] = ()

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return int(self.values.shape[1]) // 3

    def recorded(self, rows: Integers) -> Array:
        """Return the values of rows in the order of time, in consecutive rows without a copy."""
        consecutive = len(rows) > 0 and rows[-1] - rows[0] == len(rows) - 1
        return np.asarray(self.values[slice(rows[0], rows[-1] + 1) if consecutive else rows])

    def read(self, rows: Integers) -> Array:
        """Return the values of rows in the order of time, with angles unwrapped."""
        values = self.recorded(rows)
        if self.wraps:
            values = values.copy()
            values[:, : self.n_joints] = np.unwrap(values[:, : self.n_joints], axis=0)
        return values


def read_samples(
    the_map: MapFile, robot: Robot, scratch: Path, progress: Callable[[Path, int], None]
) -> Samples:
    """Read all files of a map.

    Parameters
    ----------
    scratch : Path
        Path of a new file for the samples.
    progress : callable
        Function that receives the present file and its number of rows read.

    Raises
    ------
    FileError
        A file cannot be read, or lacks a column; the message states the map's line.
    """
    conversion = Conversion(the_map, robot)
    times, complete, begins, n, wraps = [], [], [], 0, 0
    numbers: list[Integers] = []
    restarts: list[int] = []
    notes: dict[str, None] = {}
    unsigned = np.ones(conversion.n_recorded, dtype=bool)
    # greatest step, greatest and least position of each joint
    reach = np.array([[0.0], [-np.inf], [np.inf]]) * np.ones(robot.n_joints)
    with scratch.open("wb") as file:
        for number, name in enumerate(the_map.content.files):
            begins.append(n)
            last = np.empty((0, robot.n_joints))
            path = the_map.resolve(name, ("files", number))
            headers: list[int] = []
            for block in _file_blocks(the_map, number, name, notes, headers):
                finite = np.isfinite(block)
                numbers.append(
                    np.full(block.shape[1], len(block)) if finite.all() else finite.sum(axis=0)
                )
                recorded = conversion.recorded(block)
                unsigned[unsigned] = [could_lack_signs(x) for x in recorded[:, unsigned].T]
                for part in np.split(block, range(IN_CACHE, len(block), IN_CACHE)):
                    time, values = conversion.convert(part, n - begins[-1])
                    file.write(values.data)
                    times.append(time)
                    complete.append(np.isfinite(time) & conversion.complete(values))
                    q = np.concatenate([last, values[:, : robot.n_joints]]).T.copy()
                    steps = np.abs(np.diff(q))
                    # no robot moves by more than half a turn, or half of 6 m, between samples
                    wraps += int(np.count_nonzero(steps > np.pi))
                    for kept, keep, x in zip(
                        reach, (np.fmax, np.fmax, np.fmin), (steps, q, q), strict=True
                    ):
                        keep(kept, keep.reduce(x, axis=1, initial=np.nan), out=kept)
                    last, n = q[:, -1:].T, n + len(time)
                progress(path, n - begins[-1])
            if n == begins[-1]:
                raise FileError(f"{path}: has no rows; name a file with rows")
            if headers:
                restarts += [begins[-1] + row for row in headers]
                rows = (
                    f"row{'s' * (len(headers) > 1)} {', '.join(str(r + 1) for r in headers[:12])}"
                )
                more = f" and {len(headers) - 12} more" if len(headers) > 12 else ""
                notes[
                    f"{name}: the header is repeated in {rows}{more}: the recorder started anew; "
                    "parts with stamps of their own are separate recordings"
                ] = None
    time = np.concatenate(times)
    values = np.memmap(scratch, np.float64, "r+", shape=(n, 3 * robot.n_joints))
    jumping = reach[0] > (reach[1] - reach[2]) / 2
    decoded = [
        *_restore_signs(values, conversion, unsigned),
        *_restore_turns(values, conversion, jumping),
    ]
    if decoded:
        notes |= dict.fromkeys(decoded)
        wraps = sum(
            int(np.count_nonzero(np.abs(np.diff(part[:, joint])) > np.pi))
            for part in np.split(values, begins[1:])
            for joint in range(robot.n_joints)
        )
    from_date = bool(np.nanmax(np.abs(conversion.origin + time), initial=0.0) > EPOCH)
    if from_date:
        _refuse_other_date(the_map, conversion.origin)
        time -= np.nanmin(time)
    present = tuple(np.sum(numbers, axis=0).tolist())
    whole = np.concatenate(complete)
    common = np.count_nonzero(whole)
    # few common rows, and apart: by chance
    if common < min(present) / 10 and np.count_nonzero(whole[1:] & whole[:-1]) <= common / 10:
        _refuse_apart(the_map)
    return Samples(
        time, values, whole, tuple(begins), from_date, wraps, present, tuple(notes),
        tuple(restarts),
    )  # fmt: skip


def _refuse_apart(the_map: MapFile) -> None:
    """Refuse a table whose columns have numbers in different rows; name columns and rows."""
    file, time = the_map.content.files[0], the_map.content.time
    wanted = [(at, each.column) for at, each in columns_of(the_map) if each and at[0] == "joints"]
    blocks = _file_blocks(the_map, 0, file, {}, [])
    shown = np.concatenate([np.isfinite(block[:, -len(wanted) :]) for block in blocks])
    counts, joint = shown.sum(axis=0), shown.T.astype(float) @ shown
    groups: dict[int, list[str]] = {}  # names of columns, by the first column
    for column, (_, name) in enumerate(wanted):
        alike = (g for g in groups if joint[g, column] > min(counts[g], counts[column]) / 2)
        groups.setdefault(next(alike, column), []).append(str(name))
    if len(groups) < 2:
        return
    parts = [f"{', '.join(names)} in {counts[first]}" for first, names in groups.items()]
    remedy = ""
    # dates as text have the unit ns
    if file.endswith(".csv") and time and time.column and time.unit != "ns":
        stamp, kept = repr(time.column.column), repr(wanted[0][1])
        remedy = (
            f", as by pandas: d = pandas.read_csv({file!r}, sep=None, engine='python').set_index("
            f"{stamp}).select_dtypes('number'); d = d.interpolate('index')[d[{kept}].notna()]"
            "; d.to_csv('joined.csv')"
        )
    raise the_map.wrong(
        wanted[0][0],
        f"columns have numbers in different rows: of {len(shown)} rows of {file}, "
        f"{'; '.join(parts)}; like topics with stamps of their own: record them together, or "
        f"interpolate all of them at the stamps of the positions{remedy}",
    )


def positions_reached(samples: Samples, parts: Sequence[Integers]) -> tuple[Array, Array]:
    """Return the least and greatest positions of some rows, shape (n_joints,) each."""
    q = [samples.read(rows)[:, : samples.n_joints] for rows in parts]
    return np.min([x.min(axis=0) for x in q], axis=0), np.max([x.max(axis=0) for x in q], axis=0)


def _refuse_other_date(the_map: MapFile, origin: float) -> None:
    """Refuse stamps that are dates of this century in another unit than stated alone."""
    stated = the_map.content.time
    if stated is None or stated.plus is not None or abs(origin) <= EPOCH:
        return
    units = units_of_date(origin / SECONDS[stated.unit])
    if units and stated.unit not in units:
        unit, year = next(iter(units.items()))
        text = " (of times as text, in ns)" if unit == "ns" else ""
        raise the_map.wrong(
            ("time", "unit"),
            f"{stated.unit} makes the first stamp {origin:.6g} s, no date of this century; in "
            f"{unit} it is one{text}, counted from {year}: write unit: {unit}",
        )


def _restore_signs(values: Array, conversion: Conversion, unsigned: Mask) -> Iterator[str]:
    """Restore the signs of values recorded without sign; yield statements of the changes."""
    for kind, columns in conversion.kinds.items():
        lacking = np.flatnonzero(unsigned[columns.recorded]).tolist()
        recorded = {place: columns.restore(values, place) for place in lacking}
        found = {
            place: coding_of(x.round(), jumps=kind != "positions") for place, x in recorded.items()
        }
        codings = {coding for coding in found.values() if coding is not None}
        for place, x in recorded.items():
            coding, why = found[place], "smooth only in this reading"
            if coding is None and len(codings) == 1:
                (other,) = codings
                # an encoder of one turn may count its whole turn, without negative values
                one = np.isclose(2 * other.half, conversion.turns[place]).any()
                shared = kind != "positions" or not one
                coding = other if shared and other.is_shared(x.round()) else None
                why = "as of other joints"
            if coding is not None:
                columns.add(values, place, coding.decode(x.round()) - x)
                joint = columns.converted[place] % len(conversion.turns) + 1
                yield f"{kind} of joint {joint} are read as {coding}: {why}"


def _restore_turns(values: Array, conversion: Conversion, jumping: Mask) -> Iterator[str]:
    """Unwrap positions of encoders of one turn; yield statements of the changes.

    `jumping` joints have steps of more than half of their way, as at a turn of an encoder. If
    several motors move a joint, its steps are not those of one encoder.
    """
    positions = conversion.kinds["positions"]
    coupled = np.count_nonzero(positions.matrix) > len(jumping)
    for joint, own in enumerate(conversion.turns.tolist()):
        if not (jumping[joint] or coupled):
            continue
        recorded = positions.restore(values, joint)
        if not jumps(recorded):
            continue
        rounded = recorded.round()
        rounding = np.abs(np.nan_to_num(recorded - rounded)).max(initial=0.0)
        counts = rounded if rounding < WHOLE else recorded
        turn = turn_of(counts, [*own, register_turn(counts) or own[0]])
        register = None if turn else range_of(counts)
        turn = turn or (turn_of(counts, [register]) if register else None)
        # `Samples.read` removes whole turns of joints
        if turn is None or np.isclose(np.abs(turn * positions.matrix[joint]).max(), 2 * np.pi):
            continue
        positions.add(values, joint, unwrap(counts, turn) - recorded)
        yield (
            f"positions of joint {joint + 1} are unwrapped by {turn:.6g} of their unit, "
            f"{'the range of a register' if register else 'one turn of the encoder'}: the motion "
            "goes on only in this reading"
        )


def _file_blocks(
    the_map: MapFile, number: int, name: str, notes: dict[str, None], headers: list[int]
) -> Iterator[Array]:
    """Yield blocks of the map's columns, from a file and companion files.

    Adds notes, and the rows of repeated headers, from 0.
    """
    tables: dict[str, tuple[SoundTable, list[int], list[int]]] = {}
    wanted = list(columns_of(the_map))
    for position, (location, column) in enumerate(wanted):
        source = column.file if column is not None and column.file else name
        if source not in tables:
            tables[source] = (_opened(the_map, source, number, column, location), [], [])
            notes |= {f"{source}: {note}": None for note in tables[source][0].notes}
        table, columns, positions = tables[source]
        found = _indices(the_map, table, column, location)
        _refuse_used(the_map, location, set(found) & set(columns), table)
        columns.extend(found)
        positions.extend([position] * len(found))
    beside = _stamps_beside(the_map, tables)
    streams = [
        table.blocks([*columns, *beside.get(source, ())])
        for source, (table, columns, _) in tables.items()
    ]
    yield from streams[0] if len(streams) == 1 else _joined(tables, streams, beside, notes)
    headers += sorted({row for table, _, _ in tables.values() for row in table.headers})


def _joined(
    tables: Mapping[str, tuple[SoundTable, list[int], list[int]]],
    streams: Sequence[Iterator[Array]],
    beside: Mapping[str, tuple[int]],
    notes: dict[str, None],
) -> Iterator[Array]:
    """Yield blocks of files side by side, and note stamps that contradict each other."""
    every = [p for _, _, positions in tables.values() for p in positions]
    order, ends = np.argsort(every, kind="stable"), []
    for parts in _side_by_side(streams, [table.path for table, _, _ in tables.values()]):
        joined = np.concatenate(
            [x[:, : len(own)] for x, (_, own, _) in zip(parts, tables.values(), strict=True)],
            axis=1,
        )
        stamps = [x[:, -1] for x, source in zip(parts, tables, strict=True) if source in beside]
        ends += [(len(joined), np.array([joined[k, 0], *(x[k] for x in stamps)])) for k in (0, -1)]
        yield joined[:, order]
    if beside and ends:
        period = (ends[-1][1] - ends[0][1]) / max(sum(n for n, _ in ends) / 2 - 1, 1)
        for k, (source, (index,)) in enumerate(beside.items(), start=1):
            stated = _compared(ends[0][1][[0, k]], ends[-1][1][[0, k]], float(period[0]))
            if stated:
                notes[f"{source}: stamps in column {tables[source][0].names[index]} {stated}"] = (
                    None
                )


def _stamps_beside(
    the_map: MapFile, tables: Mapping[str, tuple[Table, list[int], list[int]]]
) -> dict[str, tuple[int]]:
    """Return the columns of stamps of files beside the file with the map's stamps."""
    time = the_map.content.time
    if time is None or time.column is None or time.column.file or time.plus is not None:
        return {}
    found = {}
    for source, (table, columns, _) in [*tables.items()][1:]:
        names = [str(time.column.column), *filter(is_time, table.names)]
        index = next((table.names.index(x) for x in names if x in table.names), None)
        if index is not None and index not in columns:
            found[source] = (index,)
    return found


def _compared(first: Array, last: Array, period: float) -> str:
    """Return the contradiction between stamps of two files in equal rows; "" for equal stamps.

    `first` and `last` hold the stamps of both files, `period` is that of the first.
    """
    own, other = last - first
    if not (np.isfinite([own, other]).all() and own > 0 and other > 0):
        return ""
    unit = 1000.0 ** round(float(np.log(other / own)) / float(np.log(1000.0)))
    fast, later = other / unit / own - 1.0, first[1] / unit - first[0]
    if abs(fast) * own > period:
        return (
            f"run {100 * abs(fast):.2g} % {'faster' if fast > 0 else 'slower'} than those of the "
            "first file in equal rows, so equal rows are not simultaneous; merge the files by the "
            "stamps of one clock"
        )
    if abs(later) > period:
        return (
            f"are {abs(later):.6g} {'later' if later > 0 else 'earlier'} than those of the first "
            "file in equal rows; rows count as simultaneous: if the clocks agree, merge the files "
            "by their stamps"
        )
    return ""


def columns_of(the_map: MapFile) -> Iterator[tuple[Location, ColumnName | None]]:
    """Yield all columns: times (None: the format's own), positions, torques, then velocities."""
    content = the_map.content
    if content.time is None:
        yield (), None
    elif content.time.column is not None:
        yield ("time", "column"), content.time.column
        if content.time.plus is not None:
            yield ("time", "plus", "column"), content.time.plus.column
    for key in ("position", "torque", "velocity"):
        for joint, mapped in enumerate(content.joints):
            if (part := getattr(mapped, key)) is not None:
                yield ("joints", joint, key, "column"), part.column


def _refuse_used(the_map: MapFile, location: Location, used: set[int], table: Table) -> None:
    for index in used:
        name = f" ({table.names[index]})" if table.names[index] else ""
        raise the_map.wrong(
            location,
            f"column {index + 1}{name} of {table.path} is used twice in this map; correct one of "
            "the two places",
        )


def _opened(
    the_map: MapFile, source: str, number: int, column: ColumnName | None, location: Location
) -> SoundTable:
    beside = column is not None and column.file is not None
    if beside and len(the_map.content.files) > 1:
        raise the_map.wrong(
            location,
            "a column of another file needs exactly one file under files: rows must correspond",
        )
    at = location if beside else ("files", number)
    path = the_map.resolve(source, at)
    try:
        return open_table(path, the_map.content.format)
    except FileError as error:
        raise the_map.wrong(at, str(error)) from error


def _indices(
    the_map: MapFile, table: Table, column: ColumnName | None, at: Location
) -> tuple[int, ...]:
    """Return the indices of a column in a table, from 0; two for the format's own stamps."""
    if column is None:
        if not table.time:
            raise the_map.wrong(
                (),
                f"time: missing, and {table.path} has no stamps of its own; add time: {{column:"
                " ..., unit: s}, or time: {rate: ...} in Hz",
            )
        return table.time
    try:
        return (column_of(table, column.column),)
    except NoColumn as error:
        raise the_map.wrong(at, str(error)) from error


def _side_by_side(
    streams: Sequence[Iterator[Array]], paths: Sequence[Path]
) -> Iterator[list[Array]]:
    """Yield blocks of equal rows of all streams; refuse streams of other length."""
    rest = [np.empty(0)] * len(streams)
    while True:
        waiting = [
            block if len(block) else next(stream, None)
            for block, stream in zip(rest, streams, strict=True)
        ]
        present = [block for block in waiting if block is not None]
        if not present:
            return
        if len(present) < len(waiting):
            longer, shorter = (
                next(p for p, b in zip(paths, waiting, strict=True) if (b is None) == gone)
                for gone in (False, True)
            )
            raise FileError(
                f"{longer}: has more rows than {shorter}; files side by side need equal rows"
            )
        n = min(map(len, present))
        yield [block[:n] for block in present]
        rest = [block[n:] for block in present]
