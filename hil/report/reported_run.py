"""Subject of a report: a run with friction and identification results, computed on demand."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hil.errors import FileError, HilError, Mismatch
from hil.estimation.identify import JOINT, METHODS, default_method
from hil.planning.measurement import Friction, select_kind
from hil.results.findings import found_in
from hil.results.model import Model
from hil.results.model_file import NAME, read_model_file
from hil.results.provenance import same_parameters
from hil.runs.pooling import recorded
from hil.runs.run import Run
from hil.view.along_motion import stretches

if TYPE_CHECKING:
    from hil.commands.friction import FrictionResult
    from hil.estimation.local_fits import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.findings import Findings
    from hil.results.recorded_torque import PredictedTorque
    from hil.runs.recording import Recording
    from hil.runs.recording_file import Measured

    Recordings = tuple[tuple[RecordedMotion, Recording], ...]


MODEL_LEFT_OUT = (
    "the model given to hil friction is missing, of another robot, or outside of the folder around"
    " this run; put the run of the model beside this one, and repeat hil friction --model"
)
"""Reason for half-differences in place of the model that compensated gravity."""


class ShownTorques(NamedTuple):
    """Torques to draw.

    Attributes
    ----------
    stretches : dict
        By recording and axis (from 0).
    recordings : tuple
        Motions and recordings.
    words : str
        Sentence on the recordings' relation to the model.
    """

    stretches: dict[tuple[str, int], PredictedTorque]
    recordings: Recordings
    words: str


class ReportedRun:
    """Run of any content; recordings are read, and the identification is computed, on demand.

    Results missing in the run are identified as by `hil identify`, and kept; a run about friction
    alone is not identified.

    Raises
    ------
    FileError
        A damaged recording.
    NotIdentifiable, NotEnoughData
        The recordings do not suffice, or a run about friction alone has none.
    """

    def __init__(self, source: Run) -> None:
        self.source = source

    @property
    def robot(self) -> Robot:
        """Robot of the robot file."""
        return self.source.robot

    @property
    def is_identified(self) -> bool:
        """True if the run contains more than friction measurements."""
        return not _friction_alone(self.source)

    @cached_property
    def campaign(self) -> tuple[Measured, ...]:
        """Recordings in the plan's order."""
        return tuple(self.source)

    @cached_property
    def recordings(self) -> Recordings:
        """Motions and recordings on a common time line."""
        return tuple(recorded(self.campaign))

    @cached_property
    def friction(self) -> FrictionResult | None:
        """Result of the friction measurements, None without any."""
        return friction_of_run(self.source, self.recordings)

    @cached_property
    def found(self) -> Findings:
        """Results of `hil identify`, by the method and with the other runs of the kept model.

        Without a model, the method follows from the recordings.
        """
        run = self.source
        method, together = default_method(run.motions)[0], tuple[str, ...]()
        with suppress(FileError):
            origin = read_model_file(run.path / NAME).provenance
            if origin.method in METHODS:
                method, together = origin.method, origin.together_with
        others = together if method == JOINT else ()
        beside = tuple(Run.open(_neighbour(run, Path(each))) for each in others)
        return found_in(run, method, beside, self.campaign)

    @property
    def estimate(self) -> Model:
        """Model of the estimation, with its data."""
        return self.found.model

    @cached_property
    def model(self) -> Model:
        """Model of the estimation, or the model in the folder if refined from this one."""
        found, kept = self.estimate, self._saved_model
        refined = kept and kept.refinement
        return kept if kept and refined and refined.start_digest == found.digest else found

    @cached_property
    def kept_model(self) -> Model | None:
        """Model in the run's folder, None if different from the report's model."""
        kept = self._saved_model
        differs = kept and not same_parameters(kept.values.tolist(), self.model.values)
        return kept if differs else None

    @cached_property
    def _saved_model(self) -> Model | None:
        with suppress(HilError):
            return Model.load(self.source.path / NAME)
        return None

    @cached_property
    def own_torques(self) -> ShownTorques:
        """Torques of the run itself."""
        words = "The model was identified from these recordings; hil validate uses others."
        return ShownTorques(stretches(self.model, self.recordings), self.recordings, words)

    @cached_property
    def shown_torques(self) -> ShownTorques:
        """Torques of the run used for the last validation, or the run's own torques."""
        for each in reversed(self.kept_model.validations if self.kept_model else ()):
            with suppress(HilError):
                other = tuple(
                    recorded(Run.open(_neighbour(self.source, self.source.path / each.run)))
                )
                words = f"Held out: {each.run}, not used for the model."
                return ShownTorques(stretches(self.model, other), other, words)
        return self.own_torques

    def local_values(self, kind: str) -> list[LocalValue]:
        """Return the local values of a kind of measurement, in the order of the plan."""
        return [value for value in self.estimate.local if value.kind == kind]


def _neighbour(run: Run, path: Path) -> Path:
    """Return the path of a run that a file of another run names, if both share a folder.

    The folder may be a stranger's, and its report shows the recordings of the named runs.
    """
    folder = run.path.resolve().parent
    if not path.resolve().is_relative_to(folder):
        raise FileError(
            f"{run.path}: names a run outside of {folder}: {path}; if you trust that run, move"
            " it beside this run, and repeat the command that named it"
        )
    return path


def _friction_alone(run: Run) -> bool:
    """Return True if a run contains only friction measurements."""
    return all(isinstance(each, Friction) for each in run.plan.measurements)


def friction_of_run(run: Run, recordings: Recordings) -> FrictionResult | None:
    """Evaluate the friction of a run with the settings of the last `hil friction`, None if absent.

    The settings are the model of gravity, if it is still in the folder around the run, and the
    bound of asymmetry.

    Raises
    ------
    NotEnoughData
        No recordings of friction in a run about friction alone.
    """
    if not select_kind(Friction, recordings) and not _friction_alone(run):
        return None
    # imported only for runs with friction measurements
    from hil.commands.friction import fit_friction, load_friction  # noqa: PLC0415
    from hil.estimation.friction.points import BOUND  # noqa: PLC0415

    try:
        kept = load_friction(run)
    except FileError:  # no fit was made
        return fit_friction(run, recordings=recordings)
    bound = BOUND if kept.bound is None else kept.bound
    try:
        model = kept.model_folder and _neighbour(run, Path(kept.model_folder))
        return fit_friction(run, model or None, bound, recordings)
    except (FileError, Mismatch):
        found = fit_friction(run, None, bound, recordings)
        # without names of folders, since the report may be sent to a stranger
        return replace(found, left_out=(*found.left_out, MODEL_LEFT_OUT))
