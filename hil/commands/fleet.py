"""`hil fleet`: identification and index of many runs, and tests for deviating machines.

A model with known address and state is not read again (`hil.results.fleet_index`). Addresses of
object storage (``s3://...``) go through fsspec.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from concurrent.futures import BrokenExecutor
from datetime import UTC, datetime
from functools import partial
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from checked_files.errors import HilError
from checked_files.foreign_text import whole_line
from checked_files.yaml_file import FileError, parse_yaml, read_text
from hil.least_squares.uncertainty import TWICE
from hil.optional_packages import needed_for
from hil.results.changes import changed_table
from hil.results.fleet_index import (
    ENOUGH,
    EXTRA,
    FIRST,
    NEWEST,
    Deviations,
    Fleet,
    deviations,
    known_keys,
    model_rows,
    table_of,
    write_part,
)
from hil.results.model import Model
from hil.results.model_file import NAME, ModelFile
from hil.runs.run import Run
from hil.show.charts.chart import MEASURED, MUTED, Line, Panel, Points
from hil.show.outcome import Outcome, Plot, Verdict
from hil.show.rounding import unit
from hil.show.table import Column, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.execution import Execute
    from hil.results.changes import Change

BATCH = 32
"""Models read by a job: a tenth of a second. Single models cost the command 0.2 ms more each."""
PART = 100 * BATCH
"""Models in a file of the index: an interrupted call loses at most ten seconds of one process."""
DRAWN = 12
"""Maximum number of deviations with a panel on the page."""


class ModelAddress(NamedTuple):
    """Address of a model file, with machine and key of the file state."""

    address: str
    machine: str
    key: str


class Runs(NamedTuple):
    """Runs after `index` or `identify_runs`: numbers, reasons for leaving runs out, verdicts."""

    new: int
    known: int
    left_out: tuple[str, ...]
    verdicts: Counter[str] | None = None


def index(
    folders: Sequence[str],
    path: Path,
    execute: Execute[Any, Any],
    progress: Callable[[str], object],
) -> Runs:
    """Add the models of runs below some folders to an index.

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
    known = known_keys(path)
    named = {each.address: each for folder in folders for each in _models(folder)}
    found = list(named.values())
    new = [each for each in found if each.key not in known]
    parts: dict[str, list[Any]] = {}
    left_out: list[str] = []
    read, unkept = 0, []
    batches = [new[k : k + BATCH] for k in range(0, len(new), BATCH)]
    for batch, result in execute(read_batch, batches):
        if isinstance(result, Exception):
            left_out += [f"{each.address}: {_reason(result)}" for each in batch]
        else:
            tables, reasons = result
            left_out += reasons
            for digest, part in tables.items():
                parts.setdefault(digest, []).append(part)
        read += len(batch)
        unkept += [each.key for each in batch]
        if read == len(new) or len(unkept) >= PART:
            name = hashlib.sha256("".join(sorted(unkept)).encode()).hexdigest()[:16]
            for digest, rows in parts.items():
                write_part(path, digest, name, rows)
            parts.clear()
            unkept.clear()
        progress(f"read {read} of {len(new)} models")
    return Runs(len(new) - len(left_out), len(found) - len(new), tuple(left_out))


def identify_runs(
    folders: Sequence[Path], execute: Execute[Any, Any], progress: Callable[[str], object]
) -> Runs:
    """Identify the runs below some folders, as by ``hil identify RUN``.

    A run whose model follows from its present recordings and the present program is not
    identified again, so an interrupted call is resumed by the same call.

    Parameters
    ----------
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
    known, left_out, words = 0, [], Counter[str]()
    for n, (run, result) in enumerate(execute(identify_run, runs), start=1):
        if isinstance(result, Exception):
            left_out.append(f"{run}: {_reason(result)}")
        else:
            known += result[0]
            words[result[1]] += 1
        progress(f"identified {n} of {len(runs)} runs")
    return Runs(len(runs) - known - len(left_out), known, tuple(sorted(left_out)), words)


def _reason(error: Exception) -> str:
    """Return the reason for leaving out the runs of a failed job; raise an unforeseen error."""
    if isinstance(error, BrokenExecutor):
        return "its process ended early; give the same command again"
    if isinstance(error, HilError):
        return str(error)
    raise error


def identify_run(path: Path) -> tuple[bool, str]:
    """Identify a run, and write the model; return whether it was up to date, and the verdict."""
    # numerics are loaded by the processes that identify
    from hil.results.findings import identify_and_keep, kept  # noqa: PLC0415
    from hil.results.identification import method_for  # noqa: PLC0415

    run = Run.open(path)
    method, _ = method_for(run)
    found = kept(run)
    known = found is not None and found.model.method == method and (path / NAME).exists()
    if found is None or not known:
        found = identify_and_keep(run, method)
        found.model.save(path / NAME)
    return known, found.model.verdict.word if found.model.verdict else ""


def _models(folder: str) -> Iterator[ModelAddress]:
    """Yield the addresses of models below a folder."""
    with needed_for(folder, EXTRA):
        import fsspec  # type: ignore[import-untyped]  # noqa: PLC0415 - an extra
    try:
        files, root = fsspec.core.url_to_fs(folder)
        found = sorted(str(each) for each in files.find(root) if PurePosixPath(each).name == NAME)
    except Exception as error:  # file systems raise errors of their own libraries
        raise FileError(f"{folder}: cannot be read: {whole_line(str(error))}") from error
    if root in found:
        raise FileError(f"{folder}: is a file; name a folder that contains run folders")
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
    import fsspec  # noqa: PLC0415 - an extra

    rows: dict[str, list[tuple[Any, ...]]] = {}
    left_out = []
    for each in models:
        place = each.address.removeprefix("file://")
        try:
            if place != each.address:  # opened without fsspec, which expands '*' and '::' in names
                text = read_text(place)
            else:
                try:
                    files, path = fsspec.core.url_to_fs(each.address)
                    text = files.cat_file(path).decode("utf-8-sig")
                except (OSError, ValueError) as error:
                    raise FileError(f"{place}: cannot be read: {error}") from error
            file = parse_yaml(text, ModelFile, place, without=("local", "torque_effect"))
            found = Model(**file.identified(Path(place)))
            content = hashlib.sha256(text.encode()).hexdigest()
            run = str(PurePosixPath(place).parent)
            own = model_rows(found, each.machine, run, each.key, content)
        except FileError as error:
            left_out.append(str(error))
            continue
        rows.setdefault(found.provenance.robot_digest, []).extend(own)
    return {digest: table_of(own) for digest, own in rows.items() if own}, left_out


def ask(fleets: dict[str, Fleet], rate: float) -> Outcome:
    """Test every machine of an index, with `rate` false alarms per machine in ten years."""
    tested = {name: deviations(fleet, rate) for name, fleet in fleets.items()}
    changes = [each for found in tested.values() for each in found.changes]
    machines = sorted({each.run for each in changes})
    n = sum(len(fleet.machines) for fleet in fleets.values())
    compared = sum(found.compared for found in tested.values())
    few = n - compared
    of = (
        f"{compared} comparable machines ({few} more with too few runs)" if few else f"{n} machines"
    )
    word, text = "unchanged", f"none of {of} deviates significantly"
    if changes:
        more = ", ..." if len(machines) > 5 else ""
        named = f"{', '.join(machines[:5])}{more}"
        word, text = "changed", f"{len(machines)} of {of} with significant deviations: {named}"
    elif not compared:
        word, text = "doubtful", f"none of {n} machines can be compared: each needs more runs"
    # address of the earlier run within the folder of its machine
    listed = [
        each._replace(against=each.against.rpartition(f"/{each.run}/")[2]) for each in changes
    ]
    # machines with runs in several folders may be several machines
    places: dict[str, set[str]] = {}
    for fleet in fleets.values():
        for k, run in zip(fleet.machine.tolist(), fleet.runs.tolist(), strict=True):
            name = fleet.machines[k]
            places.setdefault(name, set()).add(run.rpartition(f"/{name}/")[0])
    remarks = [
        f"machine {name}: runs below {' and '.join(sorted(folders))} count as one machine;"
        " rename a folder if they are several, and write the index anew"
        for name, folders in places.items()
        if len(folders) > 1
    ]
    return Outcome(
        (_fleets_table(fleets, tested, rate), changed_table(listed, "Deviations", "machine")),
        remarks=tuple(remarks),
        verdicts=(Verdict("good" if word == "unchanged" else "doubtful", word, text),),
        plots=tuple(
            Plot(
                f"deviations-{name}",
                partial(month_chart, fleet, tested[name].changes[:DRAWN]),
                "Deviating quantities over time, one panel each",
                "Deviating quantities over time with 95 % intervals, and the median of the fleet.",
            )
            for name, fleet in fleets.items()
            if tested[name].changes
        ),
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
        tuple(
            f"{name}: fewer than {ENOUGH} machines, each compared with its own past only"
            for name, fleet in fleets.items()
            if len(fleet.machines) < ENOUGH
        ),
    )  # fmt: skip


def month_chart(fleet: Fleet, changes: Sequence[Change]) -> Iterator[Panel]:
    """Draw deviating quantities of machines beside the median of the fleet."""
    days = (fleet.time - fleet.time.min()) / 86400.0
    month = np.floor(days / 30.0)
    for each in changes:
        q, machine = fleet.quantities.index(each.quantity), fleet.machines.index(each.run)
        at, medians = [], []
        for number in np.unique(month).tolist():
            of_month = fleet.value[month == number, q]
            if np.isfinite(of_month).any():
                at.append(float(days[month == number].mean()))
                medians.append(float(np.nanmedian(of_month)))
        own = (fleet.machine == machine) & np.isfinite(fleet.value[:, q])
        half, value = TWICE * fleet.error[own, q], fleet.value[own, q]
        yield Panel(
            (
                Line(at, medians, MUTED, "fleet, median", width=1.0),
                Points(days[own], value, "o", MEASURED, "machine", error=half, size=2.4),
            ),
            title=f"{each.run}: {each.quantity.title}",
            x_label="days since the first run",
            y_label=unit(each.quantity.unit),
            height=105.0,
        )
