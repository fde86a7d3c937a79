"""Planned motion over time: warm-up, travels and measurements, as in the dry run.

The motion is stored as knots. Trapezoids are parabolas between their corners, which cubics with
given slopes reproduce exactly; so a stroke of any length takes four knots. Trajectories take
`KNOTS` knots per period of the highest harmonic; cubics in between are off by less than 2e-5 of its
amplitude.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import cycle
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from hil.errors import InvalidValue
from hil.planning.dry_run import measurement_problems
from hil.planning.path_clearance import obstacles
from hil.planning.prediction.information import partner_strokes
from hil.planning.strokes import REST
from hil.planning.timetable import SETTLING, travel_time
from hil.planning.trapezoid import Trapezoid
from hil.view.packed import Segment, Track, describe_motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan
    from hil.planning.strokes import Strokes

    Rows = list[tuple[float, float, float]]


class Planned(NamedTuple):
    """Plan over time: knots per joint; joints rest after the last knot."""

    tracks: tuple[Track, ...]
    segments: tuple[Segment, ...]

    def evaluate(self, time: Array) -> tuple[Array, Array, Array]:
        """Compute q, qd and qdd at instants (n,), shapes (n, n_joints)."""
        found = [_cubic(track, time) for track in self.tracks]
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
    problems = problems_by_number(plan, robot)
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


def problems_by_number(plan: Plan, robot: Robot) -> dict[int, str]:
    """Return the dry run's problems by number of the measurement, from 0."""
    found: defaultdict[int, list[str]] = defaultdict(list)
    for problem in (wrong := measurement_problems(plan, robot)):
        found[int(problem.location[1])].append(problem.message)
    for number, message in () if wrong else obstacles(plan, robot):
        found[number].append(message)
    return {number: "\n".join(messages) for number, messages in found.items()}


class _Passage:
    """Knots and segments of the motion so far, in order of time."""

    def __init__(self, plan: Plan, robot: Robot) -> None:
        self.knots: list[Rows] = [[(0.0, 0.0, 0.0)] for _ in range(robot.n_joints)]
        self.segments: list[Segment] = []
        self._plan, self._robot = plan, robot
        self._place: Sequence[float] = [0.0] * robot.n_joints
        self._now = 0.0

    def note(self, kind: str, words: str, axes: tuple[int, ...] = (), **more: Any) -> None:
        """Add a segment from the end of the last one until now."""
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
        """Move the joints to `end` simultaneously, at a fraction of the limits."""
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
            self._follow(begin + REST + time, *measurement.motion(time)[:2])
            return
        self._exercise(measurement, begin)
        begin += measurement.preparation
        for number, at in enumerate(measurement.beginnings[:-1]):
            self._move(measurement.index, measurement.profile(number), begin + at)
        for partner in measurement.partners:
            for at, profile in partner_strokes(measurement, partner):
                self._move(partner.index, profile, begin + at)

    def _move(self, joint: int, profile: Trapezoid, begin: float) -> None:
        """Add a joint's profile starting at `begin` [s]."""
        if not profile.duration:
            return
        corners = np.unique([0.0, *profile.window, profile.duration])
        q, qd, _ = profile.motion(corners)
        self.knots[joint] += zip((begin + corners).tolist(), q.tolist(), qd.tolist(), strict=True)

    def _exercise(self, measurement: Strokes, begin: float) -> None:
        """Add the strokes of a measurement's exercise, which precedes the recording."""
        pair = [measurement.profile(number) for number in (0, 1)]
        took = sum(profile.duration for profile in pair)
        at = begin + measurement.preparation - measurement.exercised
        for _ in range(int(measurement.exercised / took)):
            for profile in pair:
                self._move(measurement.index, profile, at)
                at += profile.duration

    def _follow(self, time: Array, q: Array, qd: Array) -> None:
        """Add configurations (n, n_joints) at instants (n,)."""
        rows = np.dstack([np.broadcast_to(time, q.T.shape), q.T, qd.T]).tolist()
        for knots, more in zip(self.knots, rows, strict=True):
            knots.extend(map(tuple, more))


def _refuse_endless(plan: Plan, most: float = 1e6) -> None:
    """Refuse a plan with too many knots for a page, before the computation."""
    least = sum(_knots(measurement) for measurement in plan.measurements)
    rounds = plan.warm_up.duration / SETTLING if plan.warm_up else 0.0
    knots = least + 4 * len(plan.measurements[0].q) * (rounds + len(plan.measurements))
    if knots > most:
        raise InvalidValue(
            f"a page of this plan would have {knots:.3g} corners of strokes, at most"
            f" {most:.3g} can be shown; lower cycles, exercise or warm_up, or divide the plan"
        )


def _knots(measurement: Measurement) -> float:
    if measurement.streamed:
        return measurement.cycles * KNOTS * len(measurement.sine[0]) * len(measurement.q)
    exercised = measurement.exercised / measurement.profile(0).duration
    found = 4 * (measurement.n_strokes + exercised)
    for partner in measurement.partners:
        creep = measurement.n_strokes * measurement.profile(0).duration
        found += 4 * creep / partner.profile(measurement.q, 0).duration
    return found


KNOTS = 24
"""Knots per period of a trajectory's highest harmonic."""


def _cubic(track: Track, time: Array) -> tuple[Array, Array, Array]:
    """Interpolate value, first and second derivative by cubics between knots."""
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
    return value, rate, np.where(moving, 2 * c + 6 * s * d, 0.0) / safe**2
