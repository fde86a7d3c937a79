"""What a report is about: a run, read once, its friction, and what `hil identify` finds in it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hil.errors import FileError, Mismatch
from hil.estimation.identify import JOINT, METHODS, default_method
from hil.planning.measurement import Friction, recorded_as
from hil.results.findings import found_in
from hil.results.model_file import NAME, read_model_file
from hil.runs.pooling import recorded
from hil.runs.run import Run

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.findings import Findings
    from hil.results.friction_file import FrictionResult
    from hil.results.model import Model
    from hil.runs.recording import Recording
    from hil.runs.recording_file import Measured

    Recordings = tuple[tuple[RecordedMotion, Recording], ...]


@dataclass(frozen=True, slots=True, eq=False)
class ReportedRun:
    """A run, whatever it measures.

    Attributes
    ----------
    source : Run
    campaign : tuple of Measured
        All that was recorded, in the plan's order.
    recordings : tuple of (Measurement, Recording)
        The same on one time line.
    friction : FrictionResult or None
        Where friction was measured.
    """

    source: Run
    campaign: tuple[Measured, ...]
    recordings: Recordings
    friction: FrictionResult | None

    @property
    def robot(self) -> Robot:
        """The robot as its file states it."""
        return self.source.robot


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedRun(ReportedRun):
    """A run that was identified.

    Attributes
    ----------
    found : Findings
    """

    found: Findings

    @property
    def estimate(self) -> Estimate:
        """What the report is about."""
        return self.found.estimate

    @property
    def model(self) -> Model:
        """Of that estimate."""
        return self.found.model

    @property
    def robot_time(self) -> float:
        """From entering the bus to the end of the last measurement [s]."""
        return max(float(recording.time[-1]) for _, recording in self.recordings)

    def local_values(self, kind: str) -> list[LocalValue]:
        """Measurements of one kind by themselves, in the order of the plan."""
        return [value for value in self.estimate.local if value.kind == kind]


def read(source: Run) -> ReportedRun:
    """Read a run, evaluate its friction if it measured any, and take what was identified of it.

    What is not kept of the run is identified as `hil identify` does, and kept; a run about friction
    alone is not identified.

    Raises
    ------
    FileError
        A damaged recording.
    NotIdentifiable, NotEnoughData
        Recordings that do not suffice; no recording of friction in a run about friction alone.
    """
    campaign = tuple(source)
    recordings = tuple(recorded(campaign))
    own = source, campaign, recordings, friction_of_run(source, recordings)
    if _friction_alone(source):
        return ReportedRun(*own)
    return IdentifiedRun(*own, found_in(source, *_method(source), campaign))


def _method(run: Run) -> tuple[str, tuple[Run, ...]]:
    """Method of the model that `hil identify` wrote, and runs of other kinds that it was of, too.

    Without a model it is the method for what was recorded.
    """
    method, together = default_method(run.motions)[0], tuple[str, ...]()
    with suppress(FileError):
        origin = read_model_file(run.path / NAME).provenance
        if origin.method in METHODS:
            method, together = origin.method, origin.together_with
    return method, tuple(map(Run.open, together if method == JOINT else ()))


def _friction_alone(run: Run) -> bool:
    """Whether a run measures nothing but friction."""
    return all(isinstance(each, Friction) for each in run.plan.measurements)


def friction_of_run(run: Run, recordings: Recordings) -> FrictionResult | None:
    """Evaluate the friction of a run as `hil friction fit` did it last; None where there is none.

    The model of gravity, if it is still there, and the bound of asymmetry are the same.

    Raises
    ------
    NotEnoughData
        No recordings of friction in a run about friction alone.
    """
    if not recorded_as(Friction, recordings) and not _friction_alone(run):
        return None
    # of runs that measure friction: other reports need none of this
    from hil.estimation.friction.symmetry import BOUND  # noqa: PLC0415
    from hil.results.friction import evaluate  # noqa: PLC0415
    from hil.results.friction_file import load_friction  # noqa: PLC0415

    try:
        kept = load_friction(run)
        model = Path(kept.model_folder) if kept.model_folder else None
        return evaluate(run, recordings, model, BOUND if kept.bound is None else kept.bound)
    except (FileError, Mismatch):  # nothing was fitted, or its model is gone
        return evaluate(run, recordings)
