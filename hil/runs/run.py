"""A run as it lies in its folder, to be read: what was planned, on what, and what was measured.

Whoever evaluates a run takes one of these, opened once. `hil.runs.run_folder` has what measuring
adds: making the folder, writing recordings and the journal.
"""

from __future__ import annotations

import hashlib
from copy import copy
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Self

from checked_files.near import did_you_mean
from checked_files.yaml_file import FileError, load_yaml
from hil.errors import NotEnoughData, UnknownName
from hil.model.robot import Robot, load_robot
from hil.planning.plan import Plan, RecordedMotions, load_plan
from hil.runs.atomic_file import file_errors
from hil.runs.journal import Journal, read_journal
from hil.runs.recording_file import Measured, read_measured, replace_or_leave_out

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import pandas as pd

    from hil.planning.measurement import RecordedMotion

MOTIONS = "motions.yaml"
"""In place of a plan where recordings were imported."""


class Run:
    """A run: an iterable of its measurements, each also by its id, as in ``run["g01"].recording``.

    Attributes
    ----------
    path : Path
    plan : Plan or RecordedMotions
        What was to be measured, or what was recorded elsewhere and imported.
    robot : Robot
    journal : Journal
    set_aside : frozenset of str
        Ids of the measurements that are left out; see `without`.
    """

    set_aside: frozenset[str] = frozenset()

    def __init__(
        self, path: Path, plan: Plan | RecordedMotions, robot: Robot, journal: Journal
    ) -> None:
        self.path = path
        self.plan = plan
        self.robot = robot
        self.journal = journal

    @classmethod
    def open(cls, path: Path | str) -> Self:
        """Open the folder of a run.

        Raises
        ------
        FileError
            It is no run folder, or one of its files was changed or damaged.
        """
        path = Path(path)
        if not path.is_dir():
            raise FileError(f"{path}: is no run folder; make one with: hil run plan.yaml -o {path}")
        journal = read_journal(path / "run.json")
        if digest_of_file(path / "drives.yaml") != journal.drives_digest:
            raise _changed(path / "drives.yaml")
        robot = load_robot(path / "robot.yaml")
        plan: Plan | RecordedMotions
        if (file := path / MOTIONS).exists():
            plan = load_yaml(file, RecordedMotions)
        else:
            plan = load_plan(file := path / "plan.yaml", robot)
        if plan.digest != journal.plan_digest:
            raise _changed(file)
        return cls(path, plan, robot, journal)

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} {self.path}: {self.robot.name}, {len(self)} of"
            f" {len(self.motions)} measurements>"
        )

    @property
    def motions(self) -> tuple[RecordedMotion, ...]:
        """All that was planned, or imported."""
        return self.plan.measurements

    @property
    def imported(self) -> bool:
        """Whether its recordings come from elsewhere."""
        return isinstance(self.plan, RecordedMotions)

    @property
    def planned(self) -> Plan:
        """The plan.

        Raises
        ------
        FileError
            There is none: recordings were imported.
        """
        if isinstance(self.plan, RecordedMotions):
            raise FileError(
                f"{self.path}: was imported and has no plan; this needs a run that was measured"
                " here: hil run plan.yaml"
            )
        return self.plan

    def without(self, ids: Iterable[str]) -> Self:
        """Return the run with some measurements left out, as though they were not there.

        Raises
        ------
        UnknownName
            No measurement of the plan has such an id.
        """
        left, known = frozenset(ids), [m.id for m in self.motions]
        for unknown in sorted(left.difference(known)):
            raise UnknownName(
                f"{self.path}: --without {unknown}: no measurement of the plan has this id"
                f"{did_you_mean(unknown, known)}"
            )
        other = copy(self)
        other.set_aside = self.set_aside | left
        return other

    def __len__(self) -> int:
        """Return the number of measurements that have a recording."""
        return len(self.ids)

    def __bool__(self) -> bool:
        """Whether there is a run, also without any recording yet."""
        return True

    def __iter__(self) -> Iterator[Measured]:
        """Read what is there, in the plan's order; a damaged recording is a `FileError`."""
        for measurement in self.motions:
            if self._has(measurement):
                yield self.read(measurement)

    def __getitem__(self, measurement_id: str) -> Measured:
        """Read one measurement by its id.

        Raises
        ------
        UnknownName
            No measurement of the plan has this id, or it has no recording yet.
        FileError
            The recording is damaged.
        """
        if measurement_id not in self.ids:
            raise UnknownName(
                f"{self.path}: no recording of {measurement_id!r}; recorded are"
                f" {', '.join(self.ids) or 'none'}"
            )
        return self.read(next(m for m in self.motions if m.id == measurement_id))

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the measurements that have a recording, in the plan's order."""
        return tuple(m.id for m in self.motions if self._has(m))

    def _has(self, measurement: RecordedMotion) -> bool:
        taken = measurement.id not in self.set_aside
        return taken and self.recording_path(measurement).exists()

    def to_dataframe(self) -> pd.DataFrame:
        """All samples as one table, indexed by measurement and sample; needs pandas.

        Its columns are those of `hil.runs.recording.Recording.to_dataframe`.

        Raises
        ------
        ModuleNotFoundError
            There is no pandas.
        NotEnoughData
            There are no recordings.
        """
        import pandas as pd  # noqa: PLC0415 - needed for nothing else, and not installed along

        tables = {each.measurement.id: each.recording.to_dataframe() for each in self}
        if not tables:
            raise NotEnoughData(f"{self.path}: no recordings; measure them with --resume")
        return pd.concat(tables, names=["measurement", "sample"])

    def recording_path(self, measurement: RecordedMotion) -> Path:
        """Where the recording of `measurement` lies, once it is there."""
        return self.path / "recordings" / f"{measurement.id}.h5"

    def read(self, measurement: RecordedMotion) -> Measured:
        """Read and verify the recording of `measurement`.

        Raises
        ------
        FileError
            It is missing or damaged.
        """
        path = self.recording_path(measurement)
        measured = read_measured(path)
        if measured.measurement != measurement:
            raise FileError(
                f"{path}: holds another measurement than {measurement.id} of the plan;"
                f" {replace_or_leave_out(path)}"
            )
        if measured.run != self.journal.run_id:
            raise FileError(
                f"{path}: was measured in another run than that of {self.path / 'run.json'}; put"
                f" the run's own file back, {replace_or_leave_out(path)}"
            )
        return measured

    @property
    def missing(self) -> tuple[RecordedMotion, ...]:
        """Motions without a recording, in the plan's order."""
        return tuple(m for m in self.motions if not self.recording_path(m).exists())

    @property
    def shortfall(self) -> str:
        """What an estimate from this run must state besides; empty when the run is whole."""
        missing, planned = len(self.missing), len(self.motions)
        are = "is" if missing == 1 else "are"
        unmeasured = (
            f"{missing} of {planned} measurements {are} missing; measure them with --resume"
        )
        left_out = f"left out on request: {', '.join(sorted(self.set_aside))}"
        parts = (unmeasured, missing), (left_out, self.set_aside)
        return "; ".join(part for part, holds in parts if holds)


def digest_of_file(path: Path) -> str | None:
    """SHA-256 of a file, in hexadecimal; None where there is none."""
    with file_errors(path, "read"):
        if not path.exists():
            return None
        state = path.stat()
        return _digest(path, state.st_ino, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=4096)
def _digest(path: Path, *state: int) -> str:
    """SHA-256 of a file as it is in a `state`: what is replaced in one piece has another one."""
    del state
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _changed(path: Path) -> FileError:
    return FileError(
        f"{path}: was changed since the run was started; restore it or start a new run"
    )
