"""Run in a folder, for reading: plan, robot and drives, and recordings.

Evaluations take a run, opened once. `hil.runs.run_folder` adds the operations for measuring: making
the folder, writing recordings and the journal.
"""

from __future__ import annotations

import hashlib
from copy import copy
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from checked_files.near import did_you_mean
from checked_files.yaml_file import FileError, load_yaml
from hil.errors import NotEnoughData, UnknownName
from hil.model.robot import Robot
from hil.planning.plan import Plan, RecordedMotions, dump_plan, load_plan
from hil.runs.atomic_file import file_errors, own_folder, whole_folder, write_file
from hil.runs.journal import Journal, read_journal, write_journal
from hil.runs.recording_file import (
    Measured,
    checksum,
    read_measured,
    replace_or_leave_out,
    write_measured,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    import pandas as pd
    from numpy.typing import ArrayLike

    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

MOTIONS = "motions.yaml"
"""Name of the file in place of a plan in imported runs."""


class Run:
    """Run: an iterable of measurements, also available by id, as in ``run["g01"].recording``.

    Attributes
    ----------
    path : Path
    plan : Plan or RecordedMotions
        Plan, or the imported motions.
    robot : Robot
    journal : Journal
    set_aside : frozenset of str
        Ids of excluded measurements; see `exclude`.

    Examples
    --------
    >>> run = hil.Run.open("runs/first")
    >>> run, run.ids[:2]
    (<Run runs/first: manutec-r15, 39 of 39 measurements>, ('g01', 'g02'))
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
            The folder is not a run, or one of its files was changed or damaged.

        Examples
        --------
        >>> hil.Run.open("runs/head")
        <Run runs/head: pan-tilt, 2 of 2 measurements>
        """
        path = Path(path)
        if not path.is_dir():
            raise FileError(
                f"{path}: is not a run folder; make one with: hil run plan.yaml -o {path}"
            )
        journal = read_journal(path / "run.json")
        if digest_of_file(path / "drives.yaml") != journal.drives_digest:
            raise _changed(path / "drives.yaml")
        robot = Robot.load(path / "robot.yaml")
        plan: Plan | RecordedMotions
        if (file := path / MOTIONS).exists():
            plan = load_yaml(file, RecordedMotions)
        else:
            plan = load_plan(file := path / "plan.yaml", robot)
        if plan.digest != journal.plan_digest:
            raise _changed(file)
        return cls(path, plan, robot, journal)

    array_importer: ClassVar[Callable[..., Run]]
    """Importer of arrays, set by `hil.imports`, which this package does not import."""

    @staticmethod
    def import_arrays(
        robot: Robot,
        t: ArrayLike | Sequence[ArrayLike],
        q: ArrayLike | Sequence[ArrayLike],
        tau: ArrayLike | Sequence[ArrayLike],
        qd: ArrayLike | Sequence[ArrayLike] | None = None,
        *,
        alone: int | None = None,
        cut_off: float | None = None,
        accept: Sequence[str] = (),
    ) -> Run:
        """Make a run of recorded arrays, in memory; `save` writes the run into a folder.

        Time stamps, gaps and doubtful signals are treated as in imported files
        (`hil.import_recordings`).

        Parameters
        ----------
        robot : Robot
        t : array_like, shape (n_samples,)
            Time stamps [s]; for several recordings, this and all other arrays are lists.
        q, tau : array_like, shape (n_samples, n_joints)
            Positions [rad or m] and torques [N m or N], joint side; NaN for missing samples.
        qd : array_like, shape (n_samples, n_joints), optional
            Recorded velocities [rad/s or m/s].
        alone : int, optional
            Axis, from 1, moving back and forth alone in all recordings.
        cut_off : float, optional
            Cut-off frequency of the torques [Hz]; by default chosen from the recordings.
        accept : sequence of str
            Names of checks whose refusal is overruled, such as ``shape``.

        Raises
        ------
        InvalidArray
            Wrong shape, no sufficiently long stretch, or contradictory signals.

        Examples
        --------
        >>> robot = hil.Robot.load("examples/pan_tilt/head.urdf")
        >>> rows = np.loadtxt("examples/pan_tilt/excitation.csv.gz", delimiter=",", skiprows=1)
        >>> q, tau = np.deg2rad(rows[:, 1:3]), 2.5 * rows[:, 3:5]  # 2.5 N m for one ampere
        >>> run = hil.Run.import_arrays(robot, rows[:, 0], q, tau)
        >>> len(run), run.missing
        (2, ())
        """
        return Run.array_importer(robot, t, q, tau, qd, alone, cut_off, accept)

    from_arrays = import_arrays
    """Name of `import_arrays` by the convention of pandas."""

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} {self.path}: {self.robot.name}, {len(self)} of"
            f" {len(self.motions)} measurements>"
        )

    @property
    def motions(self) -> tuple[RecordedMotion, ...]:
        """All planned or imported motions."""
        return self.plan.measurements

    @property
    def imported(self) -> bool:
        """True for a run of imported recordings."""
        return isinstance(self.plan, RecordedMotions)

    @property
    def planned(self) -> Plan:
        """Plan of the run.

        Raises
        ------
        FileError
            The recordings were imported, without a plan.
        """
        if isinstance(self.plan, RecordedMotions):
            raise FileError(
                f"{self.path}: was imported and has no plan; a run measured by hil run is "
                "needed: hil run plan.yaml"
            )
        return self.plan

    def exclude(self, ids: Iterable[str]) -> Self:
        """Return the run without some measurements.

        Raises
        ------
        UnknownName
            No measurement of the plan has this id.

        Examples
        --------
        >>> len(hil.Run.open("runs/first").exclude(["g01"]))
        38
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

    def only(self, ids: Iterable[str] = (), *, kind: str | None = None) -> Self:
        """Return the run with some measurements only, by id or by kind, such as ``gravity``.

        Raises
        ------
        UnknownName
            No measurement of the plan has this id or kind.

        Examples
        --------
        >>> len(hil.Run.open("runs/first").only(kind="gravity"))
        12
        """
        wanted = set(ids) | {m.id for m in self.motions if kind is not None and m.kind == kind}
        if kind is not None and not wanted:
            kinds = sorted({m.kind for m in self.motions})
            raise UnknownName(
                f"{self.path}: no measurement of kind {kind}; kinds: {', '.join(kinds)}"
            )
        known = {m.id for m in self.motions}
        return self.exclude([*sorted(wanted - known), *(i for i in known if i not in wanted)])

    def mapped(self, change: Callable[[Measured], Recording]) -> MemoryRun:
        """Return a run in memory with recordings changed by a function.

        Parameters
        ----------
        change : callable
            Function from a measurement of this run to its changed recording.
        """
        measured = {each.measurement.id: replace(each, recording=change(each)) for each in self}
        return MemoryRun(self.path, self.plan, self.robot, self.journal, measured)

    def add_noise(
        self, torque: ArrayLike = 0.0, position: ArrayLike = 0.0, *, seed: int = 0
    ) -> MemoryRun:
        """Return the run with white noise added, in memory: a replicate of a Monte-Carlo study.

        Parameters
        ----------
        torque, position : scalar, or array_like of shape (n_joints,)
            Standard deviations [N m or N, rad or m].
        seed : int
            Seed of the noise.

        Examples
        --------
        >>> hil.Run.open("runs/first").add_noise(torque=0.1, seed=3)
        <MemoryRun runs/first: manutec-r15, 39 of 39 measurements>
        """
        rng, sizes = np.random.default_rng(seed), (np.asarray(torque), np.asarray(position))
        return self.mapped(lambda each: each.recording.add_noise(*sizes, rng))

    def save(self, path: Path | str) -> Run:
        """Write the run into a new folder, and open the folder.

        Raises
        ------
        FileError
            `path` exists already, or cannot be written.

        Examples
        --------
        >>> hil.Run.open("runs/first").only(["g01"]).save("runs/part").ids
        ('g01',)
        """
        path = Path(path)
        if path.exists():
            raise FileError(f"{path}: already exists; choose another folder")
        journal = self.journal.model_copy(update={"drives_digest": None})
        with whole_folder(path) as folder:
            own_folder(folder / "recordings")
            for each in self:
                write_measured(
                    folder / "recordings" / f"{each.measurement.id}.h5", each, self.robot
                )
            write_file(folder / "robot.yaml", self.robot.text.encode())
            if isinstance(self.plan, RecordedMotions):
                write_file(folder / MOTIONS, self.plan.text().encode())
            else:
                write_file(folder / "plan.yaml", dump_plan(self.plan).encode())
            write_journal(folder / "run.json", journal)
        return Run.open(path)

    def __len__(self) -> int:
        """Return the number of recorded measurements."""
        return len(self.ids)

    def __bool__(self) -> bool:
        """Return True, also for a run without recordings."""
        return True

    def __iter__(self) -> Iterator[Measured]:
        """Yield the recorded measurements in order; a damaged recording raises `FileError`."""
        for measurement in self.motions:
            if self._has(measurement):
                yield self.read(measurement)

    def __getitem__(self, measurement_id: str) -> Measured:
        """Read a measurement by id.

        Raises
        ------
        UnknownName
            No measurement of the plan has this id, or the measurement has no recording yet.
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
        """Ids of the recorded measurements, in the plan's order."""
        return tuple(m.id for m in self.motions if self._has(m))

    def _has(self, measurement: RecordedMotion) -> bool:
        taken = measurement.id not in self.set_aside
        return taken and self.recording_path(measurement).exists()

    def dataframe(self) -> pd.DataFrame:
        """Return all samples as a table, indexed by measurement and sample; needs pandas.

        Columns are those of `hil.runs.recording.Recording.dataframe`.

        Raises
        ------
        ModuleNotFoundError
            pandas is not installed.
        NotEnoughData
            The run has no recordings.
        """
        import pandas as pd  # noqa: PLC0415 - needed for nothing else, and not installed along

        tables = {each.measurement.id: each.recording.dataframe() for each in self}
        if not tables:
            raise NotEnoughData(f"{self.path}: no recordings; measure them with --resume")
        return pd.concat(tables, names=["measurement", "sample"])

    to_dataframe = dataframe
    """Name of `dataframe` by the convention of pandas."""

    def digest_of(self, measurement: RecordedMotion) -> str | None:
        """Return the SHA-256 of a recording, in hexadecimal; None without a recording."""
        return digest_of_file(self.recording_path(measurement))

    def recording_path(self, measurement: RecordedMotion) -> Path:
        """Return the path of the recording of `measurement`."""
        return self.path / "recordings" / f"{measurement.id}.h5"

    def read(self, measurement: RecordedMotion) -> Measured:
        """Read and verify the recording of `measurement`.

        Raises
        ------
        FileError
            The recording is missing or damaged.
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
                f"{path}: was measured in another run than that of {self.path / 'run.json'}; "
                f"restore the run's own file, {replace_or_leave_out(path)}"
            )
        return measured

    @property
    def missing(self) -> tuple[RecordedMotion, ...]:
        """Motions without a recording, in the plan's order."""
        return tuple(m for m in self.motions if not self.recording_path(m).exists())

    @property
    def shortfall(self) -> str:
        """Missing and left-out measurements in words, for estimates; empty for a complete run."""
        missing, planned = len(self.missing), len(self.motions)
        are = "is" if missing == 1 else "are"
        unmeasured = (
            f"{missing} of {planned} measurements {are} missing; measure them with --resume"
        )
        left_out = f"left out on request: {', '.join(sorted(self.set_aside))}"
        parts = (unmeasured, missing), (left_out, self.set_aside)
        return "; ".join(part for part, holds in parts if holds)


class MemoryRun(Run):
    """Run with recordings in memory; the path is a name for messages, and no folder.

    Attributes
    ----------
    measured : dict
        Measurements by id.
    """

    def __init__(
        self,
        path: Path,
        plan: Plan | RecordedMotions,
        robot: Robot,
        journal: Journal,
        measured: dict[str, Measured],
    ) -> None:
        super().__init__(path, plan, robot, journal)
        self.measured = measured

    def _has(self, measurement: RecordedMotion) -> bool:
        return measurement.id in self.measured and measurement.id not in self.set_aside

    def read(self, measurement: RecordedMotion) -> Measured:
        """Return the recording of `measurement`."""
        return self.measured[measurement.id]

    def digest_of(self, measurement: RecordedMotion) -> str | None:
        """Return the SHA-256 of a recording's arrays, in hexadecimal; None without a recording."""
        found = self.measured.get(measurement.id)
        return None if found is None else checksum(found.recording.arrays, {})

    @property
    def missing(self) -> tuple[RecordedMotion, ...]:
        """Motions without a recording, in the plan's order."""
        return tuple(m for m in self.motions if m.id not in self.measured)


def opened(run: Run | Path | str) -> Run:
    """Return a run, opened if given by a folder."""
    return run if isinstance(run, Run) else Run.open(run)


def digest_of_file(path: Path) -> str | None:
    """Return the SHA-256 of a file, in hexadecimal; None for a missing file."""
    with file_errors(path, "read"):
        if not path.exists():
            return None
        state = path.stat()
        return _digest(path, state.st_ino, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=4096)
def _digest(path: Path, *state: int) -> str:
    """Return the SHA-256 of a file in a `state`; a replaced file has another state."""
    del state
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _changed(path: Path) -> FileError:
    return FileError(
        f"{path}: was changed since the run was started; restore it or start a new run"
    )
