"""What a run shows against its robot file: left-out parameters, needless ones, Fig. 7.

It is kept as `diagnosis.yaml` in the run's folder. Reports show it without computing it again, so
the file says of what it was made: the recordings, the robot file, and the parameters of the
estimate that it stood beside.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from checked_files.yaml_file import FileModel, load_yaml
from hil.errors import Mismatch
from hil.estimation.absent_parameters import examine
from hil.estimation.gravity_phase import Phase, Sinusoid, shifted_most
from hil.estimation.identify import estimate
from hil.estimation.two_step_methods import prepared_for
from hil.model.base_parameters import base_parameters
from hil.results.provenance import RunStamp, named, same_parameters
from hil.runs.atomic_file import write_file
from hil.runs.journal import now
from hil.runs.pooling import recorded
from hil.show.rounding import signed, uncertain
from hil.show.table import Table, figures, table
from hil.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.estimation.absent_parameters import ModelErrors
    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.runs.run import Run
    from hil.show.table import Row


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Findings of one run; `phase` is None where nothing left out shows in gravity torques."""

    robot: Robot
    estimate: Estimate
    errors: ModelErrors
    phase: Phase | None


def diagnose(run: Run) -> Diagnosis:
    """Estimate a run anew and test its robot file.

    Raises
    ------
    NotIdentifiable
        Measurements that do not suffice.
    Mismatch
        A run that was imported.
    """
    if run.imported:
        raise Mismatch(
            f"{run.path}: was imported, and a diagnosis compares measurements of one element at a"
            " time, which only hil run makes; to test a link parameter by imported recordings, add"
            " it to the parameters in the robot file, import and identify again, and see whether"
            " its interval holds zero"
        )
    recordings = list(recorded(run))
    robot = run.robot
    with named(run):
        best = estimate(robot, recordings)
    errors = examine(robot, prepared_for(robot, best, recordings))
    shifted = shifted_most(best, errors, robot.torque_limit) if errors.found else None
    return Diagnosis(robot, best, errors, shifted)


NAME = "diagnosis.yaml"
AS_TESTED = ("names", "value", "standard_error", "t", "p_value")
"""What is kept of a candidate as it was tested."""
SHOWN = 8
"""Candidates in the ranking."""


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

    @classmethod
    def of(cls, phase: Phase) -> PhaseRecord:
        """What is kept of it."""
        return cls(
            axis=phase.axis + 1,
            over=phase.over + 1,
            q=tuple(phase.q.tolist()),
            stated=astuple(phase.stated),
            extended=astuple(phase.extended),
            angle=tuple(phase.angle.tolist()),
            torque=tuple(phase.torque.tolist()),
            standard_error=tuple(None if np.isnan(e) else float(e) for e in phase.standard_error),
        )

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
    errors, base = found.errors, base_parameters(found.robot)
    beside = {c.names: c.t for c in errors.after} if errors.found else {}
    kept = DiagnosisFile(
        made=now(),
        version=__version__,
        of=RunStamp.of(run),
        p=tuple(found.estimate.p.tolist()),
        threshold=errors.threshold,
        candidates=tuple(
            CandidateRecord(
                **{name: getattr(c, name) for name in AS_TESTED}, beside=beside.get(c.names)
            )
            for c in errors.alone
        ),
        found=tuple(c.label for c in errors.found),
        needless=tuple(
            Needless(name=base.titles[k], expression=base.expressions[k], p_value=float(p_value))
            for k, p_value in enumerate(errors.p_values)
            if p_value > 0.05  # above which a stated parameter may as well be zero
        ),
        absorbed=errors.absorbed,
        unmeasured=errors.unmeasured,
        phase=PhaseRecord.of(found.phase) if found.phase else None,
    )
    write_file(run.path / NAME, kept.as_yaml(100))
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


def candidates(found: DiagnosisFile) -> Table:
    """Left-out parameters, strongest evidence first."""
    return table(
        "What the robot file leaves out, ranked by evidence",
        ("parameter", *figures("value", "std. error", "t", "p", "t beside found")),
        (_candidate(each, found) for each in found.candidates[:SHOWN]),
        "Value over standard error, t, and the chance p of one at least as great. The last column"
        " has t again beside those that were found: what only resembled them loses its evidence.",
    )


def _candidate(each: CandidateRecord, found: DiagnosisFile) -> Row:
    beside = "" if each.beside is None else signed(f"{each.beside:.1f}")
    return (
        each.label,
        *uncertain(each.value, each.standard_error),
        signed(f"{each.t:.1f}"),
        f"{each.p_value:.1g}",
        "found" if each.label in found.found else beside,
    )


def sentences(found: DiagnosisFile) -> Iterator[str]:
    """State what is significant and what it moves, and what the data do not need."""
    below = f"p below {found.threshold:.1g}"
    if found.found:
        yield f"Significant ({below}) is {', '.join(found.found)}: add it to the robot file."
    else:
        yield (
            f"None is significant ({below}): the robot file leaves out nothing that these"
            " measurements show."
        )
    if found.phase is not None:
        shift = signed(f"{math.degrees(found.phase.phase().shift):.1f}")
        yield (
            f"It moves the phase of g{found.phase.axis} over q{found.phase.over} by {shift} degrees"
            " where that sinusoid is largest."
        )
    if names := "; ".join(f"{each.name}: {each.expression}" for each in found.needless):
        yield f"Not needed by the data: {names}."
