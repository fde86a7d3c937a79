"""What a report is about: a run, read once, and what is estimated from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.estimation.identify import NotIdentifiable, estimates
from hil.report.friction_of_run import friction_of_run
from hil.results.advice import advice
from hil.results.prediction import predict
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.results.advice import Advice
    from hil.results.friction import FrictionResult
    from hil.results.prediction import Prediction
    from hil.runs.recording import Recording
    from hil.runs.recording_file import Measured
    from hil.runs.run_folder import RunFolder

    Recordings = tuple[tuple[Measurement, Recording], ...]


@dataclass(frozen=True, slots=True, eq=False)
class ReportedRun:
    """A run, whatever it measures.

    Attributes
    ----------
    folder : RunFolder
    campaign : tuple of Measured
        All that was recorded, in the plan's order.
    recordings : tuple of (Measurement, Recording)
        The same on one time line.
    friction : FrictionResult or None
        Where friction was measured.
    """

    folder: RunFolder
    campaign: tuple[Measured, ...]
    recordings: Recordings
    friction: FrictionResult | None

    @property
    def robot(self) -> Robot:
        """The robot as its file states it."""
        return self.folder.robot


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedRun(ReportedRun):
    """A run whose base parameters are identifiable.

    Attributes
    ----------
    estimate, printed : Estimate
        By the improved method, which the report is about, and by the printed one as a check.
    prediction : Prediction
        What the improved method's parameters mean in torques.
    advice : tuple of Advice
    """

    estimate: Estimate
    printed: Estimate
    prediction: Prediction
    advice: tuple[Advice, ...]

    @property
    def robot_time(self) -> float:
        """From entering the bus to the end of the last measurement [s]."""
        return max(float(recording.time[-1]) for _, recording in self.recordings)

    def local_values(self, kind: str) -> list[LocalValue]:
        """Measurements of one kind by themselves, in the order of the plan."""
        return [value for value in self.estimate.local if value.kind == kind]


def read(folder: RunFolder) -> ReportedRun:
    """Read a run and evaluate its friction, if it measured any.

    Raises
    ------
    FileError
        A damaged recording; or no recording at all in a run about friction alone.
    """
    campaign = tuple(folder)
    recordings = tuple(recorded(campaign))
    return ReportedRun(folder, campaign, recordings, friction_of_run(folder, recordings))


def identified(run: ReportedRun) -> IdentifiedRun:
    """Estimate the base parameters of a run by both methods.

    Raises
    ------
    FileError
        Measurements that do not suffice.
    """
    try:
        found = estimates(run.robot, run.recordings)
    except NotIdentifiable as error:
        raise FileError(f"{run.folder.path}: {error}") from error
    best = found["improved"]
    prediction = predict(best, run.robot)
    return IdentifiedRun(
        folder=run.folder,
        campaign=run.campaign,
        recordings=run.recordings,
        friction=run.friction,
        estimate=best,
        printed=found["printed"],
        prediction=prediction,
        advice=advice(best, prediction, run.robot, run.folder.plan, run.campaign),
    )
