"""Input of the writers of recordings, and the text file written with the recordings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from hil.runs.journal import NO_REAL_MACHINE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.runs.recording_file import Measured
    from hil.runs.run import Run


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
