"""Journal `run.json`: person, time, machine and end of the sessions of a run.

A run may have several sessions: each `hil run` with ``--resume`` adds one. Digests of plan, robot
file and drives file reveal whether a later session measures the same robot and plan.

The jitter of SYNC and lost telegrams during recordings are stated with every run. In lock-step
there is neither jitter nor loss; on the wall clock both show whether computer and bus kept the
rate. Travel between measurements does not count.
"""

from __future__ import annotations

import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from math import hypot, sqrt
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from pydantic import Field

from checked_files.yaml_file import FileError, FileModel, load_yaml
from drivers.drive_bus import SampleFlag
from hil.runs import SIMULATED
from hil.runs.atomic_file import write_file
from hil.version import DISTRIBUTION

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from drivers.drive_bus import AxisInfo
    from hil.runs.recording import Recording

NO_REAL_MACHINE = "SIMULATED: measured on the virtual plant, no real machine"
PACKAGES = (DISTRIBUTION, "canopen", "python-can", "numpy", "h5py")
FIRST = "correct the map first, as other findings may follow from this"
"""Words of a warning that comes before all findings of an identification."""
LAST = "correct the map if the joint should move"
"""Words of a warning that comes after all findings: a joint at rest is no mistake."""
EXACT = 1e-6
"""Maximum jitter caused by rounding [s]."""

_GAPS = ~SampleFlag.LIMIT & ~SampleFlag.SKIPPED & 0xFF


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages used for measuring."""
    found = {"python": sys.version.split()[0]}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


class BusName(NamedTuple):
    """Name of a bus: python-can's interface and channel."""

    interface: str = ""
    channel: str = ""

    def __str__(self) -> str:
        return f"{self.interface} {self.channel}".strip()

    @classmethod
    def read(cls, text: str) -> BusName:
        """Parse the name of a bus in a journal; names of interfaces have no spaces."""
        interface, _, channel = text.partition(" ")
        return cls(interface, channel)


class Axis(FileModel):
    """Drive as reported in a session."""

    name: str
    identity: str
    torque_resolution: float
    position_resolution: float


class RepeatedAttempt(FileModel):
    """Failed attempt at a measurement, followed by a repetition.

    Attributes
    ----------
    measurement : str
        Id of the measurement.
    attempt : int
        Number of the attempt, from 1.
    findings : tuple of str
        Findings of the attempt.
    """

    measurement: str
    attempt: int
    findings: tuple[str, ...]


class SyncTiming(FileModel):
    """Timing of SYNC in the recordings of a session.

    Attributes
    ----------
    samples, flagged, left_out : int
        Numbers of recorded SYNCs, of those with a missing, doubled, late or old telegram, and of
        skipped SYNCs.
    jitter, worst : float
        Root mean square and maximum deviation of the time between SYNCs from the period [s].
    """

    samples: int = 0
    flagged: int = 0
    left_out: int = 0
    jitter: float = 0.0
    worst: float = 0.0

    def add_recording(self, recording: Recording) -> SyncTiming:
        """Return the timing including another recording."""
        times = np.diff(recording.time)
        period = float(np.median(times))
        passed = np.maximum(1, np.rint(times / period))
        off = times - passed * period
        samples = self.samples + recording.n_samples
        return SyncTiming(
            samples=samples,
            flagged=self.flagged + int(np.any(recording.flags & _GAPS, axis=1).sum()),
            left_out=self.left_out + int(passed.sum()) - len(passed),
            jitter=hypot(self.jitter * sqrt(self.samples), float(np.linalg.norm(off)))
            / sqrt(samples),
            worst=max(self.worst, float(np.abs(off).max())),
        )

    def __str__(self) -> str:
        lost = f"{self.flagged} flagged, {self.left_out} left out"
        if self.worst < EXACT:
            return f"{self.samples} samples, {lost}; SYNC in lock-step"
        return (
            f"{self.samples} samples, {lost}; SYNC jitter {self.jitter * 1e3:.2g} ms (rms), "
            f"{self.worst * 1e3:.2g} ms at most"
        )


class Session(FileModel):
    """Session of measuring, from entering to leaving the bus."""

    started: str
    ended: str | None = None
    reason: str = "was killed"
    bus: str
    simulated: bool | None = None
    """True for the virtual plant; None in files of earlier versions."""
    axes: tuple[Axis, ...] = ()
    sync: SyncTiming = SyncTiming()
    real_time: tuple[str, ...] = ()
    """Real-time measures granted by the system; empty if not requested."""
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    """Doubts of an import that nobody has accepted."""
    repeated: tuple[RepeatedAttempt, ...] = ()
    """Failed attempts that were repeated, in order."""
    host: str = Field(default_factory=lambda: f"{platform.node()}, {platform.platform()}")
    versions: dict[str, str] = Field(default_factory=versions)


class Journal(FileModel):
    """Content of `run.json`."""

    format: Literal[1] = 1
    run_id: str | None = None
    """Identifier stored in each recording too; None in files of earlier versions and of imports."""
    plan_digest: str
    robot_digest: str
    drives_digest: str | None = None
    rehearsed: float | None = None
    """Share of the speed limits in an earlier rehearsal of the plan."""
    sessions: tuple[Session, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Doubts of imports that nobody has accepted."""
        return tuple(each for session in self.sessions for each in session.warnings)

    @property
    def simulated(self) -> bool:
        """True if all sessions used the virtual plant."""
        return bool(self.sessions) and all(was_simulated(s.simulated, s.bus) for s in self.sessions)

    def add_session(self, session: Session) -> Journal:
        """Return the journal with another session."""
        return self.model_copy(update={"sessions": (*self.sessions, session)})

    def change_last(self, **changes: object) -> Journal:
        """Return the journal with the last session changed."""
        last = self.sessions[-1].model_copy(update=changes)
        return self.model_copy(update={"sessions": (*self.sessions[:-1], last)})


def was_simulated(stated: bool | None, bus: str) -> bool:
    """Return True for the virtual plant: as stated, or by the bus in files of earlier versions.

    All results of such a run state `NO_REAL_MACHINE`.
    """
    return BusName.read(bus).interface == SIMULATED if stated is None else stated


def axis_records(axes: Sequence[AxisInfo]) -> tuple[Axis, ...]:
    """Return identity and resolution of the axes."""
    return tuple(Axis.model_validate(axis, from_attributes=True) for axis in axes)


def now() -> str:
    """Return the time of the host's clock, ISO 8601, UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def read_journal(path: Path) -> Journal:
    """Read `run.json`.

    Raises
    ------
    FileError
        The file is missing or damaged.
    """
    try:
        return load_yaml(path, Journal)  # JSON is a subset of YAML, whose errors have line numbers
    except FileError as error:
        raise FileError(f"{error}; is this the folder of a run?") from error


def write_journal(path: Path, journal: Journal) -> None:
    """Write `run.json`, completely or not at all."""
    write_file(path, journal.model_dump_json(indent=2).encode() + b"\n")
