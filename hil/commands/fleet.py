"""`hil fleet`: identification and index of many runs, and tests for deviating machines.

The index is a folder, ``robot=DIGEST/*.parquet``: one row for each run and quantity, a file for
each call of `index` and robot. A model with known address and state is not read again. DuckDB reads
the index, `hil.results.deviations` tests it. Addresses of object storage (``s3://...``) go through
fsspec.
"""

from __future__ import annotations

import hashlib
import math
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np

from checked_files.budget import refuse_beyond
from checked_files.errors import HilError
from checked_files.foreign_text import whole_line
from checked_files.yaml_file import FileError, parse_yaml, read_text
from hil.least_squares.uncertainty import TWICE
from hil.optional_packages import needed_for
from hil.results.deviations import FIRST, NEWEST, Deviations, Fleet, deviations
from hil.results.model import Model
from hil.results.model_file import NAME, ModelFile
from hil.results.quantities import Kind, Quantity, friction_quantities, quantities, reading
from hil.results.tables.changes import changed_table
from hil.runs.atomic_file import write_file
from hil.runs.run import Run
from hil.show.charts.chart import MEASURED, MUTED, Chart, Line, Panel, Points, chart
from hil.show.outcome import Outcome, Verdict
from hil.show.rounding import unit
from hil.show.section import Plot
from hil.show.table import Column, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.execution import Execute
    from hil.results.changes import Change

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
    "machine", "run", "time", "quantity", "kind", "unit", "meaning", "value", "standard_error",
    "degrees", "allowance", "indexed",
)  # fmt: skip
"""Columns without missing values."""
LAST = 253_402_300_799
"""End of the year 9999 in seconds since 1970."""
ROW, MOST = 1000, 2_000_000_000
"""Maximum memory of a row while an index is read, and of all rows: a fleet of 1000 machines with
monthly runs of three years has 1.4 million rows (`benchmarks/fleet.py`) [bytes]."""
BATCH = 32
"""Models read by one job: a fifth of a second, beside which the job's own 0.5 ms do not count."""
DRAWN = 12
"""Maximum number of deviations with a panel on the page."""


class ModelAddress(NamedTuple):
    """Address of a model file, with machine and key of the file state."""

    address: str
    machine: str
    key: str


@dataclass(frozen=True)
class Indexed:
    """Result of `index`: numbers of runs, and the reasons for leaving runs out."""

    new: int
    known: int
    left_out: tuple[str, ...]


def index(
    folders: Sequence[str],
    path: Path,
    execute: Execute[Any, Any],
    progress: Callable[[str], object],
) -> Indexed:
    """Add the models of all runs below some folders to an index.

    A run in ``FOLDER/MACHINE/.../model.yaml`` belongs to MACHINE, a run directly below the folder
    to the folder's name.

    Parameters
    ----------
    folders : sequence of str
        Folders, or addresses known to fsspec.
    path : Path
        Folder of the index; made if missing.
    execute : callable
        See `hil.execution`.
    progress : callable
        Function called regularly with a sentence on the progress.

    Raises
    ------
    FileError
        A folder without models, or an unwritable index.
    """
    present = {each.parent for each in path.glob("robot=*/*.parquet")}
    known = set()
    for place in present:
        with _readable(place):
            known |= {key for (key,) in _select(place, "DISTINCT key FROM rows").fetchall()}
    named = {each.address: each for folder in folders for each in _models(folder)}
    found = list(named.values())
    new = [each for each in found if each.key not in known]
    parts: dict[str, list[Any]] = {}
    left_out: list[str] = []
    read, batches = 0, [new[k : k + BATCH] for k in range(0, len(new), BATCH)]
    for batch, result in execute(read_batch, batches):
        if isinstance(result, Exception):
            raise result
        tables, reasons = result
        left_out += reasons
        for digest, part in tables.items():
            parts.setdefault(digest, []).append(part)
        read += len(batch)
        progress(f"read {read} of {len(new)} models")
    name = hashlib.sha256("".join(sorted(each.key for each in new)).encode()).hexdigest()[:16]
    for digest, tables in parts.items():
        write_part(path, digest, name, tables)
    return Indexed(len(new) - len(left_out), len(found) - len(new), tuple(left_out))


class Identified(NamedTuple):
    """Result of `identify_runs`: numbers of runs, and the reasons for runs without a model."""

    new: int
    known: int
    left_out: tuple[str, ...]


def identify_runs(
    folders: Sequence[Path], execute: Execute[Any, Any], progress: Callable[[str], object]
) -> Identified:
    """Identify the runs below some folders, as by ``hil identify RUN``.

    A run whose model follows from its present recordings and the present program is not
    identified again, so an interrupted call is resumed by the same call.

    Parameters
    ----------
    folders : sequence of Path
    execute : callable
        See `hil.execution`.
    progress : callable
        Function called with a sentence after every run.

    Raises
    ------
    FileError
        Folders without runs.
    """
    runs = sorted({each.parent for folder in folders for each in folder.rglob("run.json")})
    if not runs:
        raise FileError(
            f"{', '.join(map(str, folders))}: no runs below; name folders that contain run folders"
        )
    known, left_out = 0, []
    for n, (run, result) in enumerate(execute(identify_run, runs), start=1):
        if isinstance(result, HilError):
            left_out.append(f"{run}: {result}")
        elif isinstance(result, BrokenExecutor):
            left_out.append(f"{run}: its process ended early; give the same command again")
        elif isinstance(result, Exception):
            raise result
        else:
            known += result
        progress(f"identified {n} of {len(runs)} runs")
    return Identified(len(runs) - known - len(left_out), known, tuple(sorted(left_out)))


def identify_run(path: Path) -> bool:
    """Identify a run, and write its model; return whether the present model is up to date."""
    # numerics are loaded by the processes that identify
    from hil.results.findings import identify_and_keep, kept  # noqa: PLC0415
    from hil.results.identification import method_for  # noqa: PLC0415

    run = Run.open(path)
    method, _ = method_for(run)
    found = kept(run)
    if found is not None and found.model.method == method and (path / NAME).exists():
        return True
    identify_and_keep(run, method).model.save(path / NAME)
    return False


def _models(folder: str) -> Iterator[ModelAddress]:
    """Yield the addresses of all models below a folder."""
    with needed_for(folder, EXTRA):
        import fsspec  # type: ignore[import-untyped]  # noqa: PLC0415 - an extra
    files, root = fsspec.core.url_to_fs(folder)
    found = sorted(str(each) for each in files.find(root) if PurePosixPath(each).name == NAME)
    if not found:
        raise FileError(
            f"{folder}: holds no {NAME}; identify its runs first with: hil identify RUN"
        )
    for each in found:
        run = PurePosixPath(each).parent.relative_to(root).parts
        machine = run[0] if len(run) > 1 else PurePosixPath(root).name
        try:
            key = files.ukey(each)
        except FileNotFoundError:  # a broken link
            key = ""
        yield ModelAddress(files.unstrip_protocol(each), machine, key)


def read_batch(models: list[ModelAddress]) -> tuple[dict[str, Any], list[str]]:
    """Return rows of models as Arrow tables by robot, and reasons for leaving models out."""
    rows: dict[str, list[tuple[Any, ...]]] = {}
    left_out = []
    for each in models:
        try:
            digest, own = read_rows(each)
        except FileError as error:
            left_out.append(str(error))
        else:
            rows.setdefault(digest, []).extend(own)
    return {digest: table_of(own) for digest, own in rows.items() if own}, left_out


def read_rows(model: ModelAddress) -> tuple[str, list[tuple[Any, ...]]]:
    """Return the digest of a model's robot, and the rows of the model.

    Raises
    ------
    FileError
        A damaged model.
    """
    import fsspec  # noqa: PLC0415 - an extra

    place = model.address.removeprefix("file://")
    if place != model.address:  # opened without fsspec, which expands '*' and '::' in names
        text = read_text(place)
    else:
        try:
            files, path = fsspec.core.url_to_fs(model.address)
            text = files.cat_file(path).decode("utf-8-sig")
        except (OSError, ValueError) as error:
            raise FileError(f"{place}: cannot be read: {error}") from error
    file = parse_yaml(text, ModelFile, place, without=("local", "torque_effect"))
    found = Model(**file.identified(Path(place)))
    content = hashlib.sha256(text.encode()).hexdigest()
    run = str(PurePosixPath(place).parent)
    return found.provenance.robot_digest, model_rows(found, model.machine, run, model.key, content)


def model_rows(
    found: Model, machine: str, run: str, key: str, digest: str
) -> list[tuple[Any, ...]]:
    """Return the rows of a model, one for each identified quantity, in the order of `FIELDS`."""
    about, causes = found.provenance, found.excluded
    time = datetime.fromisoformat(about.measured or about.identified).timestamp()
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
        part, "DISTINCT machine, time, run FROM rows ORDER BY machine, time, run"
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
        " value, standard_error, degrees, allowance FROM rows ORDER BY indexed",
    ).fetchnumpy()
    machines, machine = np.unique(np.asarray(runs["machine"], dtype=str), return_inverse=True)
    arrays = []
    for column in ("value", "standard_error", "degrees", "allowance"):
        filled = np.full((len(machine), len(found)), np.nan)
        filled[cells["r"], cells["q"]] = cells[column]
        arrays.append(filled)
    labels = np.asarray(runs["run"], dtype=str)
    return Fleet(tuple(machines.tolist()), found, machine, runs["time"], labels, *arrays)


def ask(fleets: dict[str, Fleet], rate: float) -> Outcome:
    """Test every machine of an index, with `rate` false alarms per machine in ten years."""
    tested = {name: deviations(fleet, rate) for name, fleet in fleets.items()}
    changes = [each for found in tested.values() for each in found.changes]
    machines = sorted({each.run for each in changes})
    n = sum(len(fleet.machines) for fleet in fleets.values())
    text = (
        f"{len(machines)} of {n} machines with significant deviations: {', '.join(machines[:5])}"
        + (", ..." if len(machines) > 5 else "")
        if changes
        else f"none of {n} machines deviates significantly"
    )
    word = "changed" if changes else "unchanged"
    # address of the earlier run within the folder of its machine
    listed = [
        each._replace(against=each.against.rpartition(f"/{each.run}/")[2]) for each in changes
    ]
    return Outcome(
        (_fleets_table(fleets, tested, rate), changed_table(listed, "Deviations", "machine")),
        verdicts=(Verdict("doubtful" if changes else "good", word, text),),
        plots=tuple(_plots(fleets, tested)),
        title="Fleet",
    )


def _fleets_table(fleets: dict[str, Fleet], tested: dict[str, Deviations], rate: float) -> Table:
    return table(
        "Fleets",
        (
            Column("digest of the robot", folds=True),
            *figures("machines", "runs", "compared", "deviating"),
            "first run",
            "newest run",
        ),
        (
            (
                name, str(len(fleet.machines)), str(len(fleet.machine)),
                str(tested[name].compared), str(len({each.run for each in tested[name].changes})),
                *(datetime.fromtimestamp(float(end(fleet.time)), UTC).date().isoformat()
                  for end in (np.min, np.max)),
            )
            for name, fleet in fleets.items()
        ),
        f"Two tests per machine: its change from the first {FIRST} to the newest {NEWEST} runs "
        f"against the change of the other machines, and its newest level against the level of "
        f"the other machines. An unchanged "
        f"machine has at most {rate:g} false alarms in ten years.",
    )  # fmt: skip


def _plots(fleets: dict[str, Fleet], tested: dict[str, Deviations]) -> Iterator[Plot]:
    for name, fleet in fleets.items():
        if shown := tested[name].changes[:DRAWN]:
            yield Plot(
                f"deviations-{name}",
                partial(month_chart, fleet, shown),
                "Deviating quantities over time, one panel each",
                "Deviating quantities over time with 95 % intervals, and the median of the fleet.",
            )


def month_chart(fleet: Fleet, changes: Sequence[Change]) -> Chart:
    """Draw deviating quantities of machines beside the median of the fleet."""
    return chart(
        Panel(
            tuple(_history(fleet, each)),
            title=f"{each.run}: {each.quantity.title}",
            x_label="days since the first run",
            y_label=unit(each.quantity.unit),
            height=105.0,
        )
        for each in changes
    )


def _history(fleet: Fleet, each: Change) -> Iterator[Line | Points]:
    q, machine = fleet.quantities.index(each.quantity), fleet.machines.index(each.run)
    days = (fleet.time - fleet.time.min()) / 86400.0
    month = np.floor(days / 30.0)
    at, medians = [], []
    for number in np.unique(month).tolist():
        of_month = fleet.value[month == number, q]
        if np.isfinite(of_month).any():
            at.append(float(days[month == number].mean()))
            medians.append(float(np.nanmedian(of_month)))
    yield Line(at, medians, MUTED, "fleet, median", width=1.0)
    own = (fleet.machine == machine) & np.isfinite(fleet.value[:, q])
    half = TWICE * fleet.error[own, q]
    yield Points(days[own], fleet.value[own, q], "o", MEASURED, "machine", error=half, size=2.4)
