"""What a report is about: a run, read once, and what is estimated from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.estimation.back_and_forth.recognition import NAME as BACK_AND_FORTH
from hil.estimation.free_motion.variants import DEFAULT
from hil.estimation.identify import estimate
from hil.estimation.mistakes.finding import find_mistake
from hil.estimation.two_step_methods import estimates
from hil.report.friction_of_run import friction_of_run
from hil.results.advice import advice
from hil.results.identification import model_of
from hil.results.naming import named
from hil.results.prediction import predict
from hil.results.recorded_torque import in_si, predict_recording
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from hil.estimation.back_and_forth.half_sums import HalfSums
    from hil.estimation.estimate import Estimate
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.advice import Advice
    from hil.results.friction import FrictionResult
    from hil.results.model import Model
    from hil.results.prediction import Prediction
    from hil.results.recorded_torque import RecordedTorque
    from hil.runs.recording import Recording
    from hil.runs.recording_file import Measured
    from hil.runs.run import Run

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
    """A run whose base parameters are identifiable.

    Attributes
    ----------
    estimate : Estimate
        By the improved method, which the report is about.
    model, check : Model
        By the improved method, and by the published one as a check.
    prediction : Prediction
        What the improved method's parameters mean in torques.
    advice : tuple of Advice
    """

    estimate: Estimate
    model: Model
    check: Model
    prediction: Prediction
    advice: tuple[Advice, ...]

    @property
    def robot_time(self) -> float:
        """From entering the bus to the end of the last measurement [s]."""
        return max(float(recording.time[-1]) for _, recording in self.recordings)

    def local_values(self, kind: str) -> list[LocalValue]:
        """Measurements of one kind by themselves, in the order of the plan."""
        return [value for value in self.estimate.local if value.kind == kind]


@dataclass(frozen=True, slots=True, eq=False)
class FreeRun(ReportedRun):
    """A run of motions that somebody else recorded.

    Attributes
    ----------
    model : Model
        By the method for them.
    shown : str
        Id of the longest recording.
    torque : RecordedTorque
        Of that recording.
    """

    model: Model
    shown: str
    torque: RecordedTorque


@dataclass(frozen=True, slots=True, eq=False)
class StrokesRun(ReportedRun):
    """A run of axes that move back and forth by themselves, recorded by somebody else.

    Attributes
    ----------
    model : Model
        By the method for them.
    half_sums : tuple of HalfSums
        What each recording shows by itself.
    """

    model: Model
    half_sums: tuple[HalfSums, ...]


def read(source: Run) -> ReportedRun:
    """Read a run and evaluate its friction, if it measured any.

    Raises
    ------
    FileError
        A damaged recording.
    NotEnoughData
        No recording of friction in a run about friction alone.
    """
    campaign = tuple(source)
    recordings = tuple(recorded(campaign))
    return ReportedRun(source, campaign, recordings, friction_of_run(source, recordings))


def fitted(run: ReportedRun) -> FreeRun:
    """Identify an imported run by the method for free motions.

    Raises
    ------
    NotIdentifiable, NotEnoughData
        Recordings that do not suffice.
    """
    with named(run.source):
        found = estimate(run.robot, run.recordings, DEFAULT)
    model = model_of(run.source, found, mistake=find_mistake(run.robot, run.recordings))
    longest, recording = max(run.recordings, key=lambda each: each[1].n_samples)
    return FreeRun(
        source=run.source,
        campaign=run.campaign,
        recordings=run.recordings,
        friction=run.friction,
        model=model,
        shown=longest.id,
        torque=predict_recording(model, in_si(model, longest, recording)),
    )


def stroked(run: ReportedRun) -> StrokesRun:
    """Identify an imported run by the method for axes that move back and forth.

    Raises
    ------
    NotIdentifiable, NotEnoughData
        Recordings that do not suffice.
    """
    with named(run.source):
        found = estimate(run.robot, run.recordings, BACK_AND_FORTH)
    return StrokesRun(
        source=run.source,
        campaign=run.campaign,
        recordings=run.recordings,
        friction=run.friction,
        model=model_of(run.source, found),
        half_sums=found.half_sums,
    )


def identified(run: ReportedRun) -> IdentifiedRun:
    """Estimate the base parameters of a run by both methods.

    Raises
    ------
    NotIdentifiable
        Measurements that do not suffice.
    """
    with named(run.source):
        found = estimates(run.robot, run.recordings)
    best = found["improved"]
    prediction = predict(best, run.robot)
    model = model_of(run.source, best, mistake=find_mistake(run.robot, run.recordings))
    return IdentifiedRun(
        source=run.source,
        campaign=run.campaign,
        recordings=run.recordings,
        friction=run.friction,
        estimate=best,
        model=model,
        check=model_of(run.source, found["published"]),
        prediction=prediction,
        advice=advice(
            best, prediction, model.error_budget, run.robot, run.source.planned, run.campaign
        ),
    )
