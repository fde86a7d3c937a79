"""Index of the models of many machines: rows of a model, and Parquet files.

The index is a folder, ``robot=DIGEST/*.parquet``: one row for each run and quantity, a file for
each call of `hil fleet index` and robot, several for many runs. DuckDB reads the index.
"""

from __future__ import annotations

import math
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from checked_files.budget import refuse_beyond
from checked_files.foreign_text import whole_line
from checked_files.yaml_file import FileError
from hil.optional_packages import needed_for
from hil.results.deviations import Fleet
from hil.results.quantities import Kind, Quantity, friction_quantities, quantities, reading
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.results.model import Model

EXTRA = "fleet"
FIELDS = {
    "robot": "string", "machine": "string", "run": "string", "key": "string", "digest": "string",
    "time": "double", "method": "string", "word": "string", "findings": "string",
    "quantity": "string", "kind": "string", "axis": "int32", "speed": "double", "unit": "string",
    "meaning": "string", "value": "double", "standard_error": "double", "degrees": "double",
    "allowance": "double", "warmth": "double", "indexed": "double",
}  # fmt: skip
"""Columns of the index. `key` is the state of the file, `time` in seconds since 1970."""
FILLED_IN = (
    "machine", "run", "digest", "time", "quantity", "kind", "unit", "meaning", "value",
    "standard_error", "degrees", "allowance", "indexed",
)  # fmt: skip
"""Columns without missing values."""
COPIED_ONCE = """(SELECT rows.* REPLACE (place AS run) FROM rows JOIN (
    SELECT machine, time, digest, arg_max(run, indexed) AS place FROM rows GROUP BY ALL
) USING (machine, time, digest))"""
"""Rows in which copies of a model have the address of the copy that was indexed last."""
LAST = 253_402_300_799
"""End of the year 9999 in seconds since 1970."""
ZONES = 86_400.0
"""Largest difference between local times and time zones, rounded up to a day [s]."""
ROW, MOST = 1000, 2_000_000_000
"""Maximum memory of a row while an index is read, and of all rows: a fleet of 1000 machines with
monthly runs of three years has 1.4 million rows (`benchmarks/fleet.py`) [bytes]."""


def model_rows(
    found: Model, machine: str, run: str, key: str, digest: str
) -> list[tuple[Any, ...]]:
    """Return a row for every identified quantity of a model, in the order of `FIELDS`.

    Raises
    ------
    FileError
        An impossible date.
    """
    about, causes = found.provenance, found.excluded
    # date in seconds since 1970; refuse an impossible one, which would misorder runs
    measured = about.measured or about.identified
    time, now = math.nan, datetime.now(UTC)
    with suppress(ValueError, OverflowError):
        time = datetime.fromisoformat(measured).timestamp()
    if not 0.0 <= time <= now.timestamp() + ZONES:
        raise FileError(
            f"{run}: measured {measured[:40]!r} must be a date from 1970 to now"
            f" ({now.date()}); check the clocks of both computers, and correct the date in the file"
        )
    head = (
        about.robot, machine, run, key, digest, time, found.method,
        "" if found.verdict is None else found.verdict.word,
        "" if causes is None else "; ".join(map(str, causes.found)),
    )  # fmt: skip
    rows, indexed = [], datetime.now(UTC).timestamp()
    parameters = [each for each in quantities([found]) if each.axis is None]
    for each in (*parameters, *friction_quantities(found.robot)):
        axis = None if each.axis is None else found.friction_law.axes[each.axis - 1]
        slow, fast = (0.0, np.inf) if axis is None or axis.speeds is None else axis.speeds
        if each.speed is not None and not slow <= each.speed <= fast:
            continue
        if (read := reading(found, each)) is None or read.stands_for:
            continue
        warmth = math.nan if axis is None or axis.warmth is None else axis.warmth.reference
        rows.append((
            *head, each.name, each.kind, each.axis, each.speed, each.unit, each.meaning,
            read.value, read.standard_error, read.degrees, read.allowance, warmth, indexed,
        ))  # fmt: skip
    return rows


def table_of(rows: Sequence[tuple[Any, ...]]) -> Any:
    """Return rows in the order of `FIELDS` as an Arrow table."""
    with needed_for("the index of a fleet", EXTRA):
        import pyarrow as pa  # noqa: PLC0415 - an extra
    columns = dict(zip(FIELDS, zip(*rows, strict=True), strict=True))
    return pa.table(columns, schema=pa.schema(list(FIELDS.items())))


def write_part(path: Path, digest: str, name: str, tables: Sequence[Any]) -> None:
    """Write Arrow tables of `table_of` as one file of the index."""
    with needed_for(path, EXTRA):
        import pyarrow as pa  # noqa: PLC0415 - an extra
        from pyarrow import parquet  # noqa: PLC0415
    folder, sink = path / f"robot={digest[:16]}", pa.BufferOutputStream()
    folder.mkdir(parents=True, exist_ok=True)
    parquet.write_table(pa.concat_tables(tables), sink, compression="zstd")
    write_file(folder / f"{name}.parquet", sink.getvalue())


def known_keys(path: Path) -> set[str]:
    """Return the keys of the indexed models, `ModelAddress.key`; empty without an index."""
    known = set()
    for part in {each.parent for each in path.glob("robot=*/*.parquet")}:
        with _readable(part):
            known |= {key for (key,) in _select(part, "DISTINCT key FROM rows").fetchall()}
    return known


def _select(path: Path, what: str) -> Any:
    """Return the relation of a DuckDB query of an index, or of one robot's part of an index."""
    with needed_for(path, EXTRA):
        import duckdb  # noqa: PLC0415 - an extra
        import pyarrow as pa  # noqa: PLC0415
        from pyarrow import dataset  # noqa: PLC0415
    # files are opened by pyarrow, because DuckDB expands '*', '?' and '[' in the name of a folder
    files, schema = [str(each) for each in path.glob("*.parquet")], pa.schema(list(FIELDS.items()))
    rows = duckdb.from_arrow(dataset.dataset(files, schema=schema))
    return rows.query("rows", f"SELECT {what}")


@contextmanager
def _readable(part: Path) -> Iterator[None]:
    """Refuse a robot's part of an index if too large or not in the format of `write_part`."""
    with needed_for(part, EXTRA):
        import duckdb  # noqa: PLC0415 - an extra
        from pyarrow import ArrowException, parquet  # noqa: PLC0415
    rows, file = 0, part
    try:
        for file in sorted(part.glob("*.parquet")):
            about = parquet.ParquetFile(file)
            found = {each.name: str(each.type) for each in about.schema_arrow}
            if wrong := [each for each in FIELDS if found.get(each) != FIELDS[each]]:
                raise FileError(
                    f"{file}: is not an index of hil fleet: column {wrong[0]} must hold"
                    f" {FIELDS[wrong[0]]}, not {found.get(wrong[0], 'be missing')}; write it anew"
                )
            rows += about.metadata.num_rows
            refuse_beyond(part, ROW * rows, f"{rows} rows", MOST)
        file = part
        yield
    except (ArrowException, OSError, ValueError, duckdb.Error) as error:
        raise FileError(
            f"{file}: is not an index of hil fleet: {whole_line(str(error))}"
        ) from error


def read_fleets(path: Path) -> dict[str, Fleet]:
    """Read an index: fleets by the digest of the robot.

    Raises
    ------
    FileError
        No index.
    """
    parts = sorted({each.parent for each in path.glob("robot=*/*.parquet")})
    if not parts:
        raise FileError(f"{path}: holds no index; make one with: hil fleet index FOLDER -o {path}")
    fleets = {}
    for part in parts:
        with _readable(part):
            fleets[part.name.removeprefix("robot=")] = _fleet(part)
    return fleets


def _fleet(part: Path) -> Fleet:
    filled_in = " AND ".join(f"{each} IS NOT NULL" for each in FILLED_IN)
    usual = f"time BETWEEN 0 AND {LAST} AND kind IN {get_args(Kind)} AND {filled_in}"
    wrong = _select(part, f"machine, time, quantity FROM rows WHERE NOT ({usual}) LIMIT 1")
    for machine, time, quantity in wrong.fetchall():
        raise FileError(
            f"{part}: row of machine {whole_line(str(machine))[:40]}, time {time}, quantity"
            f" {whole_line(str(quantity))[:40]}: must have values of {', '.join(FILLED_IN)}, a"
            " known kind, and a time from 1970 to 9999; write the index anew with hil fleet index"
        )
    runs = _select(
        part, f"DISTINCT machine, time, run FROM {COPIED_ONCE} ORDER BY machine, time, run"
    ).fetchnumpy()
    kinds = _select(
        part,
        "quantity, any_value(kind), any_value(unit), any_value(axis), any_value(speed),"
        " any_value(meaning) FROM rows GROUP BY quantity ORDER BY quantity",
    ).fetchall()
    found = tuple(
        Quantity(name, kind, unit, axis=axis, speed=speed, meaning=meaning)
        for name, kind, unit, axis, speed, meaning in kinds
    )
    size = 4 * 8 * len(runs["run"]) * len(found)
    refuse_beyond(part, size, f"{len(runs['run'])} runs with {len(found)} quantities")
    # a repeated identification of a run comes last and replaces the earlier model
    cells = _select(
        part,
        "dense_rank() OVER (ORDER BY machine, time, run) - 1 AS r,"
        " dense_rank() OVER (ORDER BY quantity) - 1 AS q,"
        f" value, standard_error, degrees, allowance FROM {COPIED_ONCE} ORDER BY indexed",
    ).fetchnumpy()
    machines, machine = np.unique(np.asarray(runs["machine"], dtype=str), return_inverse=True)
    arrays = []
    for column in ("value", "standard_error", "degrees", "allowance"):
        filled = np.full((len(machine), len(found)), np.nan)
        filled[cells["r"], cells["q"]] = cells[column]
        arrays.append(filled)
    labels = np.asarray(runs["run"], dtype=str)
    return Fleet(tuple(machines.tolist()), found, machine, runs["time"], labels, *arrays)
