"""Index of the models of many machines, and machines that deviate from the others.

The index has rows of models in Parquet files: it is a folder, ``robot=DIGEST/*.parquet``: one row
for each run and quantity, a file for each call of `hil fleet index` and robot, several for many
runs. DuckDB reads the index.

Deviations of a machine from its past and from its fleet are found at a stated rate of false alarms.
A fleet is many machines of one robot, each identified repeatedly. For a quantity y
(`hil.results.quantities`) of machine k, let

    T_k = mean of the newest `NEWEST` runs - mean of the first `FIRST` runs.

An unchanged machine deviates like its peers: the null hypothesis is T_k = median of T over the
machines, with the standard error

    s = max(1.4826 median |T - median T|, r sqrt(1/NEWEST + 1/FIRST)),

r^2 = median (y_(i+1) - y_i)^2 / (2 x 0.4549) over successive runs of all machines, since the median
of a chi-squared variable with one degree of freedom is 0.4549. Medians ignore the few machines of a
fleet that change. With fewer than `ENOUGH` machines and fewer than `ENOUGH` differences, the stated
errors and allowances of the models apply, as in `hil.results.changes`. The level of a machine is
compared with the levels of its peers in the same way, by the median absolute deviation.

Temperature moves the friction of all axes. With the common change c of a run, the median over the
axes (`hil.results.changes.common_friction`), and the response b of an axis, friction is divided by
1 + b c. Least squares of the differences between successive runs yield b, with the prior 1 +-
`UNLIKE` / 2; slow wear contributes little to these differences. The uncertainty of b widens s.

Holm's procedure bounds the probability of any false alarm in one run of a machine by

    alpha = rate / (runs of a machine in ten years),

so that a machine has at most `rate` false alarms in ten years.
"""

from __future__ import annotations

import math
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np
from scipy import special

from checked_files.budget import refuse_beyond
from checked_files.foreign_text import whole_line
from checked_files.yaml_file import FileError
from hil.optional_packages import needed_for
from hil.results.changes import FEWEST, UNLIKE, Change, adjusted, change, common_shares, p_values
from hil.results.quantities import Kind, Quantity, Reading, friction_quantities, quantities, reading
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Array, Indices, Mask
    from hil.results.model import Model


NEWEST, FIRST = 3, 12
"""Numbers of runs in the newest and in the first mean: a quarter and a year of monthly runs."""
ENOUGH = 20
"""Minimum number of differences, or of machines, for a median accurate to a quarter (1.25 /
sqrt(20)).
"""
NORMAL = 1.0 / float(special.ndtri(0.75))
"""Ratio of standard deviation to median absolute deviation of a normal distribution."""
MEDIAN_SQUARE = float(special.chdtri(1, 0.5))
"""Median of a chi-squared variable with one degree of freedom."""
EFFICIENCY = 0.37
"""Efficiency of a median absolute deviation relative to a standard deviation (Huber and Ronchetti
2009, 1.1).
"""
DECADE = 10 * 365.25 * 86400.0
"""Seconds in ten years."""
FLEET = "the fleet"


@dataclass(frozen=True, slots=True, eq=False)
class Fleet:
    """Readings of machines of the same robot, ordered by machine and time.

    Attributes
    ----------
    machine : ndarray, shape (n_runs,)
        Index into `machines`, ascending.
    time : ndarray, shape (n_runs,)
        Time since 1970 [s], ascending within a machine.
    runs : ndarray, shape (n_runs,)
        Labels of the runs.
    value, error, degrees, allowance : ndarray, shape (n_runs, n_quantities)
        Attributes of `Reading`; NaN for quantities unknown to a run.
    """

    machines: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    machine: Indices
    time: Array
    runs: Array
    value: Array
    error: Array
    degrees: Array
    allowance: Array


class Deviations(NamedTuple):
    """Significant deviations of the newest run of each machine.

    Attributes
    ----------
    changes : tuple of Change
        Significant changes, the least probable first; `run` is the machine, `against` its first
        run, or the fleet.
    level : float
        Probability of any false alarm in a run of a machine.
    compared : int
        Number of machines with a comparable run.
    """

    changes: tuple[Change, ...]
    level: float
    compared: int


def deviations(fleet: Fleet, rate: float) -> Deviations:
    """Test the newest run of each machine, with `rate` false alarms per machine in ten years."""
    starts = np.searchsorted(fleet.machine, np.arange(len(fleet.machines)))
    count = np.diff(np.append(starts, len(fleet.machine)))
    level = min(rate / runs_in_ten_years(fleet), 1.0)
    place = np.arange(len(fleet.machine)) - starts[fleet.machine]
    # with few runs, the newer half, so that some runs remain for comparison
    newest = place >= (count - np.clip(count // 2, 1, NEWEST))[fleet.machine]
    first = (place < FIRST) & ~newest
    value, by_temperature = _remove_temperature(fleet, first, newest)
    new, new_error, n_new = _means(fleet, value, newest)
    old, old_error, n_old = _means(fleet, value, first)
    # standard deviation between successive runs of a machine, and the number of differences
    apart = np.diff(value, axis=0)[np.diff(fleet.machine) == 0]
    n_runs = np.isfinite(apart).sum(axis=0)
    run = np.sqrt(_median(apart**2) / (2.0 * MEDIAN_SQUARE))
    with np.errstate(divide="ignore", invalid="ignore"):
        of_runs = np.hypot(run * np.sqrt(1.0 / n_new + 1.0 / n_old), by_temperature)
    stated = np.hypot(np.hypot(new_error, old_error), by_temperature)
    # of each machine, the largest allowance and the fewest degrees of freedom
    allowance, degrees = (
        np.fmin.reduceat(x, starts, axis=0) for x in (-fleet.allowance, fleet.degrees)
    )
    own = _test(new - old, of_runs, n_runs, stated, degrees, -allowance)
    unknown = np.full(new.shape, np.nan)
    peers = _test(new, unknown, np.zeros_like(n_runs), unknown, unknown, 0.0 * unknown)
    rows = ((old, *own), (new - peers[0], *peers))
    p = np.stack([row[-1] for row in rows])
    known = np.isfinite(p)
    number = known.sum(axis=(0, 2))
    smallest = np.where(known, p, 1.0).min(axis=(0, 2))
    found: list[Change] = []
    for k in np.flatnonzero(smallest * number < level).tolist():
        against = str(fleet.runs[starts[k]]), FLEET
        tests = [
            test
            for name, row in zip(against, rows, strict=True)
            for test in _changes(fleet, row, k, name)
        ]
        found += [each for each in adjusted(tests) if each.adjusted < level]
    found.sort(key=lambda each: each.adjusted)
    return Deviations(tuple(found), level, int(np.count_nonzero(number)))


def _changes(fleet: Fleet, row: tuple[Array, ...], k: int, against: str) -> Iterator[Change]:
    """Yield the tests of machine `k`."""
    before, size, error, degrees, allowed, p = (each[k].tolist() for each in row)
    for q in np.flatnonzero(np.isfinite(p)).tolist():
        now = Reading(before[q] + size[q], error[q], degrees[q], allowed[q])
        then = Reading(before[q], 0.0, degrees[q])
        yield change(fleet.quantities[q], (fleet.machines[k], now), (against, then))


def runs_in_ten_years(fleet: Fleet) -> float:
    """Return the number of runs of a machine in ten years, by the median interval of runs."""
    apart = np.diff(fleet.time)[np.diff(fleet.machine) == 0]
    apart = apart[apart > 0.0]  # a copy does not count as another run
    return DECADE / float(np.median(apart)) if len(apart) else 1.0


def _remove_temperature(fleet: Fleet, first: Mask, newest: Mask) -> tuple[Array, Array]:
    """Divide friction by its response to temperature.

    Returns values, shape (n_runs, n_quantities), and standard errors of deviations of the machines
    by the uncertainty of the response, shape (n_machines, n_quantities).
    """
    value, machines = fleet.value.copy(), np.arange(len(fleet.machines))
    error = np.zeros((len(machines), value.shape[1]))
    friction = np.array([each.kind == "friction level" for each in fleet.quantities], dtype=bool)
    axes = np.array([each.axis or 0 for each in fleet.quantities])
    base = _means(fleet, value, first)[0][:, friction]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = value[:, friction] / base[fleet.machine] - 1.0
    if len(np.unique(axes[friction])) < FEWEST:
        return value, error
    common = common_shares(share, axes[friction])[:, np.newaxis]
    # b from successive runs of a machine, unaffected by slow wear, with the prior 1 +- UNLIKE / 2
    same = np.diff(fleet.machine, append=-1) == 0
    steps = np.diff(share, axis=0, append=np.nan)
    of_common = np.diff(common, axis=0, append=np.nan)
    used = same[:, np.newaxis] & np.isfinite(steps) & np.isfinite(of_common)
    noise = _median(np.where(used, steps - of_common, np.nan) ** 2) / MEDIAN_SQUARE
    noise = np.fmax(noise, np.finfo(float).tiny)
    prior = (UNLIKE / 2) ** -2
    n = len(machines)
    squares = _sums(np.where(used, of_common**2, 0.0), fleet.machine, n) / noise + prior
    products = _sums(np.where(used, of_common * steps, 0.0), fleet.machine, n) / noise + prior
    response = products / squares
    value[:, friction] /= 1.0 + response[fleet.machine] * common
    warm = np.repeat(common, value.shape[1], axis=1)
    away = (_means(fleet, warm, newest)[0] - _means(fleet, warm, first)[0])[:, friction]
    error[:, friction] = np.abs(away * base) / np.sqrt(squares)
    return value, error


def _sums(x: Array, machine: Indices, n: int) -> Array:
    """Sum rows by machine, shape (n, n_columns)."""
    return np.add.reduceat(
        np.vstack([x, np.zeros((1, x.shape[1]))]), np.searchsorted(machine, np.arange(n)), axis=0
    )


def _median(x: Array) -> Array:
    """Return the median of known values, by column; NaN for an empty column."""
    known = np.isfinite(x).any(axis=0)
    found = np.full(x.shape[1], np.nan)
    found[known] = np.nanmedian(x[:, known], axis=0)
    return found


def _means(fleet: Fleet, value: Array, which: Mask) -> tuple[Array, Array, Array]:
    """Return mean, error of the mean and number of `which` runs, (n_machines, n_quantities)."""
    used = which[:, np.newaxis] & np.isfinite(value)
    columns = np.ones_like(value), value, fleet.error**2
    count, total, squares = (
        _sums(np.where(used, x, 0.0), fleet.machine, len(fleet.machines)) for x in columns
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        return total / count, np.sqrt(squares) / count, count


def _test(
    T: Array, of_runs: Array, n_runs: Array, stated: Array, degrees: Array, allowance: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Return size, standard error, degrees of freedom, allowance and p-value of deviations T."""
    machines = np.isfinite(T).sum(axis=0)
    many, repeated = machines >= ENOUGH, n_runs >= ENOUGH
    known = many | repeated
    size = T - np.where(many, _median(T), 0.0)
    spread = np.where(many, NORMAL * _median(np.abs(size)), 0.0)
    error = np.where(known, np.fmax(np.where(repeated, of_runs, 0.0), spread), stated)
    degrees = np.where(known, EFFICIENCY * np.where(many, machines, n_runs), degrees)
    allowed = np.where(known, 0.0, allowance)
    p = p_values(np.abs(size), allowed, np.where(error > 0.0, error, np.nan), degrees)
    return size, error, degrees, allowed, p


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
