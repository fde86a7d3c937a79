"""What a report is about: a run, read once, and what is estimated from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.report.friction_of_run import friction_of_run
from hil.results.findings import findings
from hil.results.kept_findings import keep, kept
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from hil.estimation.back_and_forth.half_sums import HalfSums
    from hil.estimation.estimate import Estimate
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.findings import Findings
    from hil.results.friction import FrictionResult
    from hil.results.model import Model
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
    found : Findings
    """

    found: Findings

    @property
    def estimate(self) -> Estimate:
        """By the improved method, which the report is about."""
        return self.found.estimate

    @property
    def model(self) -> Model:
        """By the improved method."""
        return self.found.model

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
    # of motions recorded elsewhere alone: other reports need none of this
    from hil.estimation.free_motion.variants import DEFAULT  # noqa: PLC0415
    from hil.estimation.identify import estimate  # noqa: PLC0415
    from hil.estimation.mistakes.finding import find_mistake  # noqa: PLC0415
    from hil.results.identification import model_of  # noqa: PLC0415
    from hil.results.naming import named  # noqa: PLC0415
    from hil.results.recorded_torque import in_si, predict_recording  # noqa: PLC0415

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
    from hil.estimation.back_and_forth.recognition import NAME as BACK_AND_FORTH  # noqa: PLC0415
    from hil.estimation.identify import estimate  # noqa: PLC0415 - as above
    from hil.results.identification import model_of  # noqa: PLC0415
    from hil.results.naming import named  # noqa: PLC0415

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
    """Take what is kept of a run's estimates, or estimate it by both methods and keep that.

    Raises
    ------
    NotIdentifiable
        Measurements that do not suffice.
    """
    found = kept(run.source)
    if found is None:
        found = findings(run.source, run.campaign, run.recordings)
        keep(run.source, found)
    return IdentifiedRun(run.source, run.campaign, run.recordings, run.friction, found)
