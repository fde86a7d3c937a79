"""Run as a folder of tables in CSV or Parquet: a file per measurement, and an index.

Names of columns state their units. Times, positions, torques, flags and stroke numbers are as
recorded, to the last bit. Velocities are present only if they were recorded. Set-points follow from
the plan and are marked as derived.

CSV has one header line and numbers only, as PlotJuggler and pandas expect, with enough digits to
restore the same double. A missing sample is an empty cell, since PlotJuggler takes a column
starting with the word nan for text. Parquet has the same tables, each column with its unit and
source, and with metadata of the measurement.

`Job` is the input of the writers of all formats of recordings, `readme` the text file beside them.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from drivers.drive_bus import SampleFlag
from hil.optional_packages import needed_for
from hil.planning.free_motion import FreeMotion
from hil.runs.atomic_file import new_file, own_folder
from hil.runs.journal import NO_REAL_MACHINE
from hil.runs.set_points import set_points

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from typing import IO

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording_file import Measured

    Values = Array | NDArray[np.uint8] | NDArray[np.int16]
    from pathlib import Path

    from hil.runs.run import Run


UNKNOWN = "unknown unit"
"""Unit of torques with an unknown gain."""
_IN_NAMES = {
    "rad": "rad",
    "m": "m",
    "rad/s": "rad_per_s",
    "m/s": "m_per_s",
    "N m": "Nm",
    "N": "N",
    UNKNOWN: "unknown_unit",
}
_FLAGS = ", ".join(f"{flag.value} {str(flag.name).lower()}" for flag in SampleFlag)


def unknown_gains(motion: RecordedMotion) -> tuple[int, ...]:
    """Return the axes, from 1, with torques of unknown gain."""
    return (motion.unknown_gains or ()) if isinstance(motion, FreeMotion) else ()


def row(measured: Measured) -> dict[str, str | int | float]:
    """Return the row of a measurement in the index, by column names.

    Axes are numbered from 1; ``axes`` are the moving axes, ``read`` those with recorded torque.
    """
    motion, recording = measured.measurement, measured.recording
    return {
        "id": motion.id,
        "kind": motion.kind,
        "axes": " ".join(str(axis + 1) for axis in motion.moved),
        "read": " ".join(str(axis + 1) for axis in motion.read),
        "session": measured.session,
        "samples": recording.n_samples,
        "begins_s": float(recording.time[0]),
        "ends_s": float(recording.time[-1]),
        "attempts": measured.attempts,
        "findings": "; ".join(finding.message for finding in measured.findings),
    }


def columns(robot: Robot, measured: Measured) -> Iterator[Column]:
    """Return the table of a measurement, time first."""
    motion, recording = measured.measurement, measured.recording

    def velocity_unit(axis: int) -> str:
        return f"{robot.position_unit(axis)}/s"

    def torque_unit(axis: int) -> str:
        return UNKNOWN if axis + 1 in unknown_gains(motion) else robot.torque_unit(axis)

    yield Column("time_s", "s", "time since the bus was entered in its session", recording.time)
    yield from _joints("q", "position", robot.position_unit, recording.q)
    if recording.qd is not None:
        yield from _joints("qd", "velocity", velocity_unit, recording.qd)
    yield from _joints("tau", "torque or force", torque_unit, recording.tau)
    planned = set_points(motion, recording)
    if planned is not None:
        for column in _joints("set", "set-point", robot.position_unit, planned):
            yield column._replace(derived=True)
    for axis, flags in enumerate(recording.flags.T, start=1):
        yield Column(f"flags{axis}", "", f"flags of joint {axis}, a sum of {_FLAGS}", flags)
    yield Column("stroke", "", "number of the stroke, -1 for none", recording.stroke)
    if recording.group is not None:
        what = "number of the period, block or pair of strokes, -1 for none"
        yield Column("group", "", what, recording.group)
    partner = "number of the partner's stroke, -1 for none"
    yield Column("partner_stroke", "", partner, recording.partner_stroke)


def _joints(
    letter: str, what: str, unit_of: Callable[[int], str], values: Array
) -> Iterator[Column]:
    for axis, each in enumerate(values.T):
        unit = unit_of(axis)
        name = f"{letter}{axis + 1}_{_IN_NAMES[unit]}"
        yield Column(name, unit, f"{what} of joint {axis + 1}", each)


FOLDER = "recordings"
"""Folder of the tables; the index is in its parent folder."""


def write_csv(job: Job) -> None:
    """Write the tables of a run as CSV."""

    def write(file: IO[bytes], rows: Iterable[Sequence[Any]]) -> None:
        text = io.TextIOWrapper(file, "utf-8", newline="")
        csv.writer(text, lineterminator="\n").writerows(rows)
        text.detach()

    _write_tables(
        job,
        "csv",
        lambda file, table, _: write(file, _rows_of(table)),
        lambda file, rows: write(file, [list(rows[0]), *(list(each.values()) for each in rows)]),
    )


def _rows_of(table: Sequence[Column], at_a_time: int = 1 << 14) -> Iterator[Sequence[Any]]:
    """Yield the column names, then the rows, converted to Python numbers in small blocks."""
    yield [column.name for column in table]
    for begin in range(0, len(table[0].values), at_a_time):
        some = [column.values[begin : begin + at_a_time] for column in table]
        yield from zip(
            *(np.where(np.isnan(each), "", each.astype(object)).tolist() for each in some),
            strict=True,
        )


def write_parquet(job: Job) -> None:
    """Write the tables of a run as Parquet.

    Raises
    ------
    FileError
        pyarrow is not installed.
    """
    with needed_for("--to parquet"):
        import pyarrow  # noqa: PLC0415 - optional
        import pyarrow.parquet  # noqa: PLC0415 - optional
    run = facts(job)

    def field(column: Column) -> Any:
        origin = "derived" if column.derived else "recorded"
        stated = {"unit": column.unit, "what": column.what, "origin": origin}
        kind = pyarrow.from_numpy_dtype(column.values.dtype)
        return pyarrow.field(column.name, kind, metadata=stated)

    def write(file: IO[bytes], table: Sequence[Column], measured: Measured) -> None:
        stated = {key: str(value) for key, value in row(measured).items()}
        stated["measurement"] = measured.measurement.model_dump_json()
        schema = pyarrow.schema([field(column) for column in table], metadata=run | stated)
        arrays = [pyarrow.array(column.values) for column in table]
        pyarrow.parquet.write_table(pyarrow.table(arrays, schema=schema), file)

    def write_index(file: IO[bytes], rows: Sequence[dict[str, Any]]) -> None:
        listed = {name: [each[name] for each in rows] for name in rows[0]}
        pyarrow.parquet.write_table(pyarrow.table(listed, metadata=run), file)

    _write_tables(job, "parquet", write, write_index)


def _write_tables(
    job: Job,
    ending: str,
    write: Callable[[IO[bytes], Sequence[Column], Measured], None],
    write_index: Callable[[IO[bytes], Sequence[dict[str, Any]]], None],
) -> None:
    """Write the tables ``recordings/ID.ending``, ``index.ending``, and column descriptions."""
    rows: list[dict[str, Any]] = []
    seen: dict[str, Column] = {}
    own_folder(job.folder / FOLDER)
    for measured in job:
        name = f"{FOLDER}/{measured.measurement.id}.{ending}"
        table = tuple(columns(job.run.robot, measured))
        with new_file(job.folder / name) as file:
            write(file, table, measured)
        rows.append({"file": name, **row(measured)})
        seen = {column.name: column for column in table} | seen
    with new_file(job.folder / f"index.{ending}") as file:
        write_index(file, rows)
    with new_file(job.folder / README) as file:
        file.write(readme(job, about_columns(seen.values())).encode())


class Column(NamedTuple):
    """A column of a measurement's table.

    Attributes
    ----------
    name : str
        Name with the unit, such as ``q1_rad``: letters, digits and underscores.
    unit : str
        Empty for flags and numbers.
    what : str
        Description in words.
    values : array (n,)
        NaN where a sample is missing.
    derived : bool
        True for a column computed after the measurement.
    """

    name: str
    unit: str
    what: str
    values: NDArray[Any]
    derived: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """Run with the destination of its recordings.

    Attributes
    ----------
    folder : Path
        Empty folder for all files.
    joints : tuple of str
        Names of the joints, in order.
    progress : callable
        Function called with the id of each measurement before writing.
    """

    run: Run
    folder: Path
    joints: tuple[str, ...]
    progress: Callable[[str], None]

    def __iter__(self) -> Iterator[Measured]:
        """Read the run's measurements, reporting progress."""
        for measured in self.run:
            self.progress(measured.measurement.id)
            yield measured


README = "README.txt"
NOTES = (
    "Time begins anew in each session; the index states the session of each measurement.",
    "An empty cell, or NaN: no sample at this SYNC.",
    "Velocities only where recorded; drives report none.",
    "Derived columns were not recorded: set-points follow from the plan and from the strokes.",
)


def facts(job: Job) -> dict[str, str]:
    """Return robot and run in words, by short keys."""
    run, sessions = job.run, job.run.journal.sessions
    buses = dict.fromkeys(session.bus for session in sessions)
    found = {
        "run": run.path.resolve().name,
        "run id": run.journal.run_id or "none",
        "robot": f"{run.robot.name} (robot file {run.robot.digest[:12]})",
        "joints": ", ".join(job.joints),
        "recorded": NO_REAL_MACHINE if run.journal.simulated else ", ".join(buses),
        "sessions": ", ".join(session.started for session in sessions),
        "measurements": f"{len(run)} of {len(run.motions)}",
    }
    return found | ({"note": run.shortfall} if run.shortfall else {})


def readme(job: Job, about: Sequence[str]) -> str:
    """Return the text of the readme file: description of the run, and lines on the data."""
    stated = [f"{key}: {text}" for key, text in facts(job).items()]
    head = "Recordings of a run, in SI units on the joint side."
    return "\n".join([head, "", *stated, "", *about, ""])


def about_columns(columns: Iterable[Column]) -> list[str]:
    """Return lines about the columns of tables."""
    listed = []
    for column in columns:
        unit = f" [{column.unit}]" if column.unit else ""
        origin = "derived" if column.derived else "recorded"
        listed.append(f"{column.name}: {column.what}{unit}, {origin}")
    return [*NOTES, "", *listed]
