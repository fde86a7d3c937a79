"""Content of a page for a robot, a plan or a run."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.model.capsules import capsules
from hil.planning.workspace import narrow_ranges
from hil.runs.pooling import recorded
from hil.show.rounding import count
from hil.view.along_motion import (
    concatenate_recordings,
    distances,
    join_predictions,
    predicted,
    smallest,
)
from hil.view.packed import shown_kinds
from hil.view.planned import planned
from hil.view.stretches import stretches
from hil.view.visuals import robot_data, workspace_data

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.planning.workspace import Workspace
    from hil.results.model import Model
    from hil.runs.run import Run
    from hil.view.along_motion import Distances, MeasuredTracks, Predicted
    from hil.view.packed import Segment, Track
    from hil.view.visuals import Visual


ANGLE = 1e-5
"""Resolution of a position [rad or m]."""
WITHOUT_MODEL = "No torque without a model; --model RUN adds predicted torque."


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Content of a page.

    Attributes
    ----------
    title : str
    robot : Robot
    workspace : Workspace, optional
    visuals : sequence of Visual
        Meshes in place of capsules.
    segments : tuple of Segment
        Segments of the time line; empty for a robot at rest.
    planned : tuple of Track, optional
        Planned position of each joint, or its set-points.
    measured : MeasuredTracks, optional
    predicted : Predicted, optional
    distances : Distances, optional
    notes : tuple of str
        Remarks for the reader.
    simulated : bool
        True if anything shown comes from the virtual plant.
    """

    title: str
    robot: Robot
    workspace: Workspace | None = None
    visuals: Sequence[Visual] = ()
    segments: tuple[Segment, ...] = ()
    planned: tuple[Track, ...] | None = None
    measured: MeasuredTracks | None = None
    predicted: Predicted | None = None
    distances: Distances | None = None
    notes: tuple[str, ...] = ()
    simulated: bool = False

    def data(self) -> dict[str, object]:
        """Convert to the data read by the page's scripts."""
        kinds = shown_kinds(segment.kind for segment in self.segments)
        number = {kind["name"]: n for n, kind in enumerate(kinds)}
        return {
            "title": self.title,
            "robot": robot_data(narrow_ranges(self.robot, self.workspace), self.visuals),
            "workspace": workspace_data(self.workspace),
            "kinds": kinds,
            "segments": [_segment(each, number[each.kind]) for each in self.segments],
            "planned": _tracks(self.planned, ANGLE),
            "measured": self._measured(),
            "predicted": _tracks(self.predicted.tracks if self.predicted else None),
            "band": _tracks(self.predicted.band if self.predicted else None),
            "prediction": self.predicted.words if self.predicted else None,
            "distance": self.distances.data() if self.distances else None,
        }

    def _measured(self) -> dict[str, object] | None:
        if self.measured is None:
            return None
        return {
            "position": _tracks(self.measured.position, ANGLE),
            "velocity": _tracks(self.measured.velocity),
            "torque": _tracks(self.measured.torque),
        }


def robot_scene(
    robot: Robot, workspace: Workspace | None = None, visuals: Sequence[Visual] = ()
) -> Scene:
    """Create the scene of a robot with adjustable joints."""
    return Scene(
        title=f"{robot.name}: {robot.n_joints} joints",
        robot=robot,
        workspace=workspace,
        visuals=visuals,
        notes=_describe_capsules(robot),
    )


def plan_scene(
    plan: Plan,
    robot: Robot,
    most: int,
    model: Model | None = None,
    visuals: Sequence[Visual] = (),
) -> Scene:
    """Create the scene of a plan, with the timing of the dry run.

    Parameters
    ----------
    most : int
        Maximum number of instants for torques and distances.
    model : Model, optional
        Model for predicted torques.

    Raises
    ------
    InvalidValue
        The plan has more strokes than a page can show.
    """
    passed = planned(plan, robot)
    time = _instants(passed.segments[-1].end, most)
    q, qd, qdd = passed.evaluate(time)
    near = distances(robot, plan.workspace, time, q)
    torque = predicted(model, time, q, qd, qdd) if model else None
    return Scene(
        title=f"{robot.name}: plan of {count(len(plan.measurements), 'measurement')}",
        robot=robot,
        workspace=plan.workspace,
        visuals=visuals,
        segments=passed.segments,
        planned=passed.tracks,
        predicted=torque,
        distances=near,
        notes=(
            "Motion of the dry run, from all joints at 0: the robot's position is unknown.",
            *_describe_distance(near, plan.workspace),
            *_describe_capsules(robot),
            *(() if torque else (WITHOUT_MODEL,)),
        ),
        simulated=_is_simulated(model),
    )


def run_scene(
    run: Run, most: int, model: Model | None = None, visuals: Sequence[Visual] = ()
) -> Scene:
    """Create the scene of a run's recordings, with set-points.

    Parameters
    ----------
    most : int
        Maximum total number of displayed instants.
    model : Model, optional
        Model for predicted torques.

    Raises
    ------
    NotEnoughData
        The run has no recordings.
    FileError
        A recording is damaged.
    """
    pairs = tuple(recorded(run))
    if not pairs:
        raise NotEnoughData(f"{run.path}: no recordings to show; measure them with --resume")
    shown = tuple(join_predictions(pairs, stretches(model, pairs) if model else {}))
    found = concatenate_recordings(run.robot, shown, most)
    workspace = None if run.imported else run.planned.workspace
    time = _instants(found.segments[-1].end, most)
    q = np.column_stack([np.interp(time, each.time, each.value) for each in found.position])
    near = distances(run.robot, workspace, time, q)
    return Scene(
        title=f"{run.robot.name}: {len(run)} of {len(run.motions)} recordings of {run.path.name}",
        robot=run.robot,
        workspace=workspace,
        visuals=visuals,
        segments=found.segments,
        planned=found.set_point,
        measured=found,
        predicted=found.predicted,
        distances=near,
        notes=(
            "As measured. Pauses are left out; travel between recordings was not recorded "
            "and is drawn as a straight line.",
            *_describe_distance(near, workspace),
            *_describe_capsules(run.robot),
        ),
        simulated=run.journal.simulated or _is_simulated(model),
    )


def _is_simulated(model: Model | None) -> bool:
    return model is not None and model.provenance.any_simulated


def _instants(duration: float, most: int) -> Array:
    """Return instants for torques and distances, 10 ms apart, at most `most`."""
    n = int(min(max(duration / 0.01, 1), most))
    return np.linspace(0.0, duration, n + 1)


def _describe_distance(found: Distances | None, workspace: Workspace | None) -> tuple[str, ...]:
    if found is None or workspace is None:
        return ()
    words = smallest(found, workspace)
    return (f"{words[0].upper()}{words[1:]}.",)


def _describe_capsules(robot: Robot) -> tuple[str, ...]:
    """Describe capsules that are only assumed."""
    stated = capsules(robot).stated
    if all(stated):
        return ()
    links = ", ".join(str(link) for link, known in enumerate(stated, start=1) if not known)
    return (f"Capsules assumed (none in the robot file) for: link {links}.",)


def _segment(segment: Segment, kind: int) -> dict[str, object]:
    begin, end = round(segment.begin, 4), round(segment.end, 4)
    return {**asdict(segment), "kind": kind, "begin": begin, "end": end}


def _tracks(
    tracks: Sequence[Track] | None, step: float | None = None
) -> list[dict[str, object]] | None:
    """Convert tracks to the page's data, by default to 5e-4 of the largest value."""
    if tracks is None:
        return None
    return [
        track.data(step or 5e-4 * max(float(np.nanmax(np.abs(track.value), initial=0.0)), 1e-6))
        for track in tracks
    ]
