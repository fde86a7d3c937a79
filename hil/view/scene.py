"""Content of a page for a robot, a plan or a run.

Planned motion over time has warm-up, travels and measurements, as in the dry run. It is stored as
knots. Trapezoids are parabolas between their corners, which cubics with given slopes reproduce
exactly; so a stroke of any length takes four knots. Trajectories take `KNOTS` knots per period of
the highest harmonic; cubics in between are off by less than 2e-5 of its amplitude.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import asdict, dataclass
from itertools import cycle
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from hil.errors import InvalidValue, NotEnoughData
from hil.model.capsules import capsules
from hil.planning.dry_run import measurement_problems
from hil.planning.prediction.information import partner_strokes
from hil.planning.strokes import REST
from hil.planning.timetable import SETTLING, obstacles, travel_time
from hil.planning.trapezoid import Trapezoid
from hil.planning.workspace import narrow_ranges
from hil.runs.pooling import recorded
from hil.show.rounding import count
from hil.view.along_motion import (
    concatenate_recordings,
    distances,
    join_predictions,
    predicted,
    smallest,
    stretches,
)
from hil.view.packed import Segment, Track, describe_motion, shown_kinds
from hil.view.visuals import robot_data, workspace_data

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan
    from hil.planning.workspace import Workspace
    from hil.results.model import Model
    from hil.runs.run import Run
    from hil.view.along_motion import Distances, MeasuredTracks, Predicted
    from hil.view.visuals import Visual

    Rows = list[tuple[float, float, float]]


KNOTS = 24
"""Knots per period of a trajectory's highest harmonic."""


class Planned(NamedTuple):
    """Plan over time: knots per joint; joints rest after the last knot."""

    tracks: tuple[Track, ...]
    segments: tuple[Segment, ...]

    def evaluate(self, time: Array) -> tuple[Array, Array, Array]:
        """Compute q, qd and qdd at instants (n,), shapes (n, n_joints)."""
        found = []
        for track in self.tracks:
            slope = cast("Array", track.slope)  # derivatives of planned motions are known
            last = np.clip(np.searchsorted(track.time, time, side="right") - 1, 0, None)
            following = np.minimum(last + 1, len(track.time) - 1)
            width = track.time[following] - track.time[last]
            moving = width > 0
            safe = np.where(moving, width, 1.0)
            s = np.where(moving, (time - track.time[last]) / safe, 0.0)
            way = track.value[following] - track.value[last]
            a, b = slope[last] * safe, slope[following] * safe
            c, d = 3 * way - 2 * a - b, a + b - 2 * way
            value = track.value[last] + s * (a + s * (c + s * d))
            rate = np.where(moving, a + s * (2 * c + 3 * s * d), 0.0) / safe
            found.append((value, rate, np.where(moving, 2 * c + 6 * s * d, 0.0) / safe**2))
        q, qd, qdd = (np.column_stack(each) for each in zip(*found, strict=True))
        return q, qd, qdd


def planned(plan: Plan, robot: Robot) -> Planned:
    """Compute the motion of `robot` for `plan`, starting with all joints at 0 like the dry run.

    Raises
    ------
    InvalidValue
        The plan has more strokes than a page can show.
    """
    _refuse_endless(plan)
    # the dry run's problems by number of the measurement, from 0
    found: defaultdict[int, list[str]] = defaultdict(list)
    for problem in (wrong := measurement_problems(plan, robot)):
        found[int(problem.location[1])].append(problem.message)
    for number, message in () if wrong else obstacles(plan, robot):
        found[number].append(message)
    problems = {number: "\n".join(messages) for number, messages in found.items()}
    passage = _Passage(plan, robot)
    passage.warm_up()
    for number, measurement in enumerate(plan.measurements):
        passage.travel(measurement.start, plan.travel)
        passage.note("travel", f"travel to {measurement.id}")
        passage.measure(measurement)
        passage.note(
            measurement.kind, describe_motion(measurement), measurement.read,
            recorded=True, problem=problems.get(number),
        )  # fmt: skip
    tracks = tuple(Track(*np.array(knots).T) for knots in passage.knots)
    return Planned(tracks, tuple(passage.segments))


class _Passage:
    """Knots and segments of the motion so far, in order of time."""

    def __init__(self, plan: Plan, robot: Robot) -> None:
        self.knots: list[Rows] = [[(0.0, 0.0, 0.0)] for _ in range(robot.n_joints)]
        self.segments: list[Segment] = []
        self._plan, self._robot = plan, robot
        self._place: Sequence[float] = [0.0] * robot.n_joints
        self._now = 0.0

    def note(self, kind: str, words: str, axes: tuple[int, ...] = (), **more: Any) -> None:
        begin = self.segments[-1].end if self.segments else 0.0
        self.segments.append(Segment(kind, words, begin, self._now, axes, **more))

    def warm_up(self) -> None:
        """Cycle through the plan's configurations for the duration of the warm-up."""
        warm_up = self._plan.warm_up
        targets = cycle(end for m in self._plan.measurements for end in (m.start, m.end))
        while warm_up and self._now < warm_up.duration:
            self.travel(next(targets), warm_up.fraction)
        if warm_up:
            self.note("warm-up", "warm-up")

    def travel(self, end: Sequence[float], fraction: float) -> None:
        robot = self._robot
        velocity, acceleration = (
            fraction * limit for limit in (robot.velocity_limit, robot.acceleration_limit)
        )
        for joint, (target, v, a) in enumerate(zip(end, velocity, acceleration, strict=True)):
            start = self.knots[joint][-1][1]
            self._move(joint, Trapezoid(start, float(target), float(v), float(a)), self._now)
        self._now += travel_time(robot, self._place, end, fraction) + SETTLING
        self._place = end

    def measure(self, measurement: Measurement) -> None:
        """Add a measurement, starting at rest."""
        begin, self._now = self._now, self._now + measurement.duration
        if measurement.streamed:
            n = measurement.cycles * KNOTS * len(measurement.sine[0])
            time = np.linspace(0.0, measurement.cycles * measurement.period, n + 1)
            q, qd, _ = measurement.motion(time)
            at_once = np.broadcast_to(begin + REST + time, q.T.shape)
            rows = np.dstack([at_once, q.T, qd.T]).tolist()
            for knots, more in zip(self.knots, rows, strict=True):
                knots.extend(map(tuple, more))
            return
        # the exercise precedes the recording
        pair = [measurement.profile(number) for number in (0, 1)]
        at = begin + measurement.preparation - measurement.exercised
        for _ in range(int(measurement.exercised / sum(each.duration for each in pair))):
            for profile in pair:
                self._move(measurement.index, profile, at)
                at += profile.duration
        begin += measurement.preparation
        for number, at in enumerate(measurement.beginnings[:-1]):
            self._move(measurement.index, measurement.profile(number), begin + at)
        for partner in measurement.partners:
            for at, profile in partner_strokes(measurement, partner):
                self._move(partner.index, profile, begin + at)

    def _move(self, joint: int, profile: Trapezoid, begin: float) -> None:
        if not profile.duration:
            return
        corners = np.unique([0.0, *profile.window, profile.duration])
        q, qd, _ = profile.motion(corners)
        self.knots[joint] += zip((begin + corners).tolist(), q.tolist(), qd.tolist(), strict=True)


def _refuse_endless(plan: Plan, most: float = 1e6) -> None:
    """Refuse a plan with too many knots for a page, before the computation."""
    least = 0.0
    for measurement in plan.measurements:
        if measurement.streamed:
            waves = measurement.cycles * len(measurement.sine[0])
            least += KNOTS * waves * len(measurement.q)
            continue
        stroke = measurement.profile(0).duration
        least += 4 * (measurement.n_strokes + measurement.exercised / stroke)
        for partner in measurement.partners:
            creep = measurement.n_strokes * stroke
            least += 4 * creep / partner.profile(measurement.q, 0).duration
    rounds = plan.warm_up.duration / SETTLING if plan.warm_up else 0.0
    knots = least + 4 * len(plan.measurements[0].q) * (rounds + len(plan.measurements))
    if knots > most:
        raise InvalidValue(
            f"a page of this plan would have {knots:.3g} corners of strokes, at most"
            f" {most:.3g} can be shown; lower cycles, exercise or warm_up, or divide the plan"
        )


ANGLE = 1e-5
"""Resolution of a position [rad or m]."""
WITHOUT_MODEL = "No torque without a model; --model RUN adds predicted torque."


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Content of a page.

    Attributes
    ----------
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
        measured = self.measured and {
            "position": _tracks(self.measured.position, ANGLE),
            "velocity": _tracks(self.measured.velocity),
            "torque": _tracks(self.measured.torque),
        }
        segments = [
            asdict(each)
            | {"kind": number[each.kind], "begin": round(each.begin, 4), "end": round(each.end, 4)}
            for each in self.segments
        ]
        return {
            "title": self.title,
            "robot": robot_data(narrow_ranges(self.robot, self.workspace), self.visuals),
            "workspace": workspace_data(self.workspace),
            "kinds": kinds,
            "segments": segments,
            "planned": _tracks(self.planned, ANGLE),
            "measured": measured,
            "predicted": _tracks(self.predicted.tracks if self.predicted else None),
            "band": _tracks(self.predicted.band if self.predicted else None),
            "prediction": self.predicted.words if self.predicted else None,
            "distance": self.distances.data() if self.distances else None,
        }


def robot_scene(
    robot: Robot,
    workspace: Workspace | None = None,
    _most: int = 0,
    visuals: Sequence[Visual] = (),
) -> Scene:
    """Create the scene of a robot with adjustable joints, without instants."""
    return Scene(
        title=f"{robot.name}: {robot.n_joints} joints",
        robot=robot,
        workspace=workspace,
        visuals=visuals,
        notes=_describe_capsules(robot),
    )


def plan_scene(
    plan: Plan, robot: Robot, most: int, model: Model | None = None, visuals: Sequence[Visual] = ()
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
    stated = capsules(robot).stated
    if all(stated):
        return ()
    links = ", ".join(str(link) for link, known in enumerate(stated, start=1) if not known)
    return (f"Capsules assumed (none in the robot file) for: link {links}.",)


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
