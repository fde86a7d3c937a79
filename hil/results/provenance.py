"""Origin of a result: the run with its state, for detecting outdated results."""

from __future__ import annotations

import hashlib
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from checked_files.yaml_file import FileModel, load_yaml
from hil.errors import NoLoad, NotEnoughData, NotIdentifiable
from hil.runs.atomic_file import write_file
from hil.runs.journal import was_simulated
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Array


class Provenance(FileModel):
    """Origin of a model.

    `together_with` names further runs of the model, `without` measurements left out by the user,
    `drives` the identity of each axis's drive in the last session (empty if not recorded), and
    `warnings` doubts about imports. `simulated` states if any of the runs was measured on the
    virtual plant. `recordings` is a digest of each recording (`digests`). Both are None and empty
    in files of earlier versions.
    """

    robot: str
    robot_digest: str
    plan_digest: str
    measured: str
    bus: str
    simulated: bool | None = None
    drives: tuple[str, ...] = ()
    measurements: int
    missing: int = 0
    together_with: tuple[str, ...] = ()
    left_out: tuple[str, ...]
    without: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    identified: str
    method: str
    version: str
    recordings: tuple[str, ...] = ()

    @property
    def any_simulated(self) -> bool:
        """True if any recording of the model was measured on the virtual plant."""
        return was_simulated(self.simulated, self.bus)


class KeptResult(FileModel):
    """Result of a command, kept in a folder under the first of `names`; others are earlier ones.

    Lines of the file have up to `width` characters.
    """

    names: ClassVar[tuple[str, ...]]
    width: ClassVar[int] = 100

    def write(self, folder: Path) -> Path:
        """Write the result into a folder, whole or not at all; return the path of the file."""
        path = folder / self.names[0]
        write_file(path, self.encode_yaml(self.width))
        return path

    @classmethod
    def read(cls, folder: Path) -> Self | None:
        """Read the result in a folder; None without a file.

        Raises
        ------
        FileError
            A damaged file.
        """
        paths = (folder / name for name in cls.names)
        return next((load_yaml(path, cls) for path in paths if path.exists()), None)


class RunStamp(FileModel):
    """State of a run at the time of a result.

    Attributes
    ----------
    folder : str
        Path relative to the folder of the result.
    measured : str
        Start of the last session.
    recordings : str
        Digest of all recordings, byte by byte.
    """

    folder: str
    measured: str
    robot_digest: str
    plan_digest: str
    recordings: str

    @classmethod
    def create(cls, folder: Run, holder: Path | None = None) -> RunStamp:
        """Return the present state of a run; `holder` is the folder of the result."""
        sessions = folder.journal.sessions
        return cls(
            folder=os.path.relpath(folder.path, holder or folder.path),
            measured=sessions[-1].started if sessions else "",
            robot_digest=folder.robot.digest,
            plan_digest=folder.journal.plan_digest,
            recordings=_recordings(folder),
        )

    def change(self, folder: Run) -> str:
        """Return the first difference of the run from the recorded state; empty for none."""
        now = RunStamp.create(folder)
        for name, then, is_now in (
            ("robot file", self.robot_digest, now.robot_digest),
            ("plan", self.plan_digest, now.plan_digest),
            ("recordings", self.recordings, now.recordings),
        ):
            if then != is_now:
                return f"the {name} of {folder.path} changed after the result was written"
        return ""

    def change_beside(self, holder: Run) -> str:
        """Return the change of a run outside the result's folder; empty for a missing run."""
        path = holder.path / self.folder
        return self.change(Run.open(path)) if path.exists() else ""


def _recordings(folder: Run) -> str:
    digest = hashlib.sha256()
    for measurement in folder.plan.measurements:
        if found := folder.digest_of(measurement):
            digest.update(bytes.fromhex(found))
    return digest.hexdigest()


def digests(folder: Run, length: int = 16) -> tuple[str, ...]:
    """Return digests of all recordings in use, byte by byte; copies have the same digests.

    16 characters are 64 bits, by chance the same in 1 of 2e19.
    """
    ids = set(folder.ids)
    taken = (motion for motion in folder.motions if motion.id in ids)
    kept = [folder.digest_of(motion) for motion in taken]
    return tuple(digest[:length] for digest in kept if digest)


def recordings_in_common(made: Provenance, run: Run) -> int:
    """Return the number of recordings of a run used by a model.

    Models of earlier versions contain no digests. Then the number is all or none, judged by the
    run's plan and the time of measurement.
    """
    own = digests(run)
    if made.recordings:
        return len(set(own).intersection(made.recordings))
    stamp = RunStamp.create(run)
    same = made.measured == stamp.measured and made.plan_digest == stamp.plan_digest
    return len(own) if same and made.measured else 0


def same_recordings(one: Run, other: Run) -> bool:
    """Return True if two folders contain the same recordings, byte by byte."""
    return one.path.resolve() == other.path.resolve() or _recordings(one) == _recordings(other)


def same_parameters(then: Sequence[float], now: Array, same: float = 1e-6) -> str:
    """Return a remark if the parameters of a result differ from the present estimate, else "".

    Recordings may be the same and the program another; `same` is a share of the parameters.
    """
    if len(then) == len(now) and np.allclose(then, now, rtol=same, atol=same):
        return ""
    return "the present estimate from the same recordings has other parameters"


@contextmanager
def named(run: Run) -> Iterator[None]:
    """Add the run's path to the messages of errors about its measurements."""
    try:
        yield
    except (NotEnoughData, NotIdentifiable, NoLoad) as error:
        raise type(error)(f"{run.path}: {error}") from error
