"""`diagnosis.yaml`: what a run shows against its robot file, as a file in its folder.

Reports show it without computing it again, so the file says of what it was made: the recordings,
the robot file, and the parameters of the estimate that it stood beside.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

import numpy as np
import yaml

from checked_files.yaml_file import FileModel, load_yaml
from hil.estimation.gravity_phase import Phase, Sinusoid
from hil.model.base_parameters import base_parameters
from hil.results.stamp import RunStamp, same_parameters
from hil.runs.atomic_file import write_file
from hil.runs.journal import now

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.absent_parameters import Candidate
    from hil.results.diagnosis import Diagnosis
    from hil.runs.run import Run

    Array = NDArray[np.float64]

NAME = "diagnosis.yaml"
NEEDLESS = 0.05
"""p-value above which a stated parameter may as well be zero."""


class CandidateRecord(FileModel):
    """Left-out parameters that look alike; see `hil.estimation.absent_parameters.Candidate`."""

    names: tuple[str, ...]
    value: float
    standard_error: float
    t: float
    p_value: float
    beside: float | None
    """t beside all that were found; None for those themselves, and where none was."""

    @property
    def label(self) -> str:
        """The names as one."""
        return " or ".join(self.names)


class Needless(FileModel):
    """A stated base parameter that may as well be zero."""

    name: str
    expression: str
    p_value: float


class PhaseRecord(FileModel):
    """Fig. 7 as figures; see `hil.estimation.gravity_phase.Phase`. Axes count from 1."""

    axis: int
    over: int
    q: tuple[float, ...]
    stated: tuple[float, float, float]
    extended: tuple[float, float, float]
    angle: tuple[float, ...]
    torque: tuple[float, ...]
    standard_error: tuple[float | None, ...]

    def phase(self) -> Phase:
        """As the diagnosis had it."""
        return Phase(
            axis=self.axis - 1,
            over=self.over - 1,
            q=np.array(self.q),
            stated=Sinusoid(*self.stated),
            extended=Sinusoid(*self.extended),
            angle=np.array(self.angle),
            torque=np.array(self.torque),
            standard_error=np.array([np.nan if e is None else e for e in self.standard_error]),
        )


class DiagnosisFile(FileModel):
    """Content of `diagnosis.yaml`.

    Attributes
    ----------
    p : tuple of float
        Base parameters of the estimate that the residuals were of.
    candidates : tuple of CandidateRecord
        Each tested by itself, strongest evidence first.
    found : tuple of str
        Labels of the significant ones.
    threshold : float
        p-value below which a candidate is significant.
    absorbed, unmeasured : tuple of str
        Left-out parameters that cannot show at all, and those that these measurements do not show.
    """

    format: Literal[1] = 1
    made: str
    version: str
    of: RunStamp
    p: tuple[float, ...]
    threshold: float
    candidates: tuple[CandidateRecord, ...]
    found: tuple[str, ...]
    needless: tuple[Needless, ...]
    absorbed: tuple[str, ...]
    unmeasured: tuple[str, ...]
    phase: PhaseRecord | None

    def stale(self, folder: Run, p: Array) -> str:
        """Why it does not belong to this run as it is now; empty if it does."""
        return self.of.change(folder) or same_parameters(self.p, p)


def write_diagnosis(run: Run, found: Diagnosis) -> DiagnosisFile:
    """Write `diagnosis.yaml` into the run's folder, whole or not at all, and return it."""
    kept = _content(run, found)
    text = yaml.safe_dump(kept.model_dump(mode="json"), sort_keys=False, width=100)
    write_file(run.path / NAME, text.encode())
    return kept


def load_diagnosis(folder: Run) -> DiagnosisFile | None:
    """Read the diagnosis of a run, if there is one.

    Raises
    ------
    FileError
        A damaged file.
    """
    path = folder.path / NAME
    return load_yaml(path, DiagnosisFile) if path.exists() else None


def _needless(found: Diagnosis) -> tuple[Needless, ...]:
    """Stated parameters that the data do not need."""
    base = base_parameters(found.robot)
    return tuple(
        Needless(name=base.names[k], expression=base.expressions[k], p_value=float(p_value))
        for k, p_value in enumerate(found.errors.p_values)
        if p_value > NEEDLESS
    )


def _content(folder: Run, found: Diagnosis) -> DiagnosisFile:
    errors = found.errors
    beside = {c.names: c.t for c in errors.after} if errors.found else {}
    return DiagnosisFile(
        made=now(),
        version=version("canopen-robot-identification"),
        of=RunStamp.of(folder),
        p=tuple(found.estimate.p.tolist()),
        threshold=errors.threshold,
        candidates=tuple(_candidate(c, beside.get(c.names)) for c in errors.alone),
        found=tuple(c.label for c in errors.found),
        needless=_needless(found),
        absorbed=errors.absorbed,
        unmeasured=errors.unmeasured,
        phase=_phase(found.phase) if found.phase else None,
    )


def _candidate(c: Candidate, beside: float | None) -> CandidateRecord:
    return CandidateRecord(
        names=c.names,
        value=c.value,
        standard_error=c.standard_error,
        t=c.t,
        p_value=c.p_value,
        beside=beside,
    )


def _phase(phase: Phase) -> PhaseRecord:
    stated, extended = phase.stated, phase.extended
    return PhaseRecord(
        axis=phase.axis + 1,
        over=phase.over + 1,
        q=tuple(phase.q.tolist()),
        stated=(stated.mean, stated.cosine, stated.sine),
        extended=(extended.mean, extended.cosine, extended.sine),
        angle=tuple(phase.angle.tolist()),
        torque=tuple(phase.torque.tolist()),
        standard_error=tuple(None if np.isnan(e) else float(e) for e in phase.standard_error),
    )
