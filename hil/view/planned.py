"""The motion of a whole plan in time, as the dry run reckons it: warm-up, travels, measurements."""

from __future__ import annotations

from collections import defaultdict
from itertools import cycle
from typing import TYPE_CHECKING, NamedTuple

from hil.errors import InvalidValue
from hil.planning.dry_run import measurement_problems
from hil.planning.path_clearance import obstacles
from hil.planning.timetable import SETTLING, travel_time
from hil.view.motion import KNOTS, Motion, MotionBuilder
from hil.view.segment import Segment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan

MOST_KNOTS = 1_000_000
"""Of all joints together; a page with more does not open in reasonable time."""


class Planned(NamedTuple):
    """A plan in time."""

    motion: Motion
    segments: tuple[Segment, ...]


def planned(plan: Plan, robot: Robot) -> Planned:
    """Let `robot` pass `plan`, from all joints at 0 as the dry run does.

    Raises
    ------
    InvalidValue
        More strokes than a page can show.
    """
    _refuse_endless(plan)
    problems = problems_by_number(plan, robot)
    passage = _Passage(plan, robot)
    passage.warm_up()
    for number, measurement in enumerate(plan.measurements):
        passage.travel(measurement.start, plan.travel, f"travel to {measurement.id}")
        passage.measure(measurement, problems.get(number))
    return Planned(passage.builder.finish(), tuple(passage.segments))


def problems_by_number(plan: Plan, robot: Robot) -> dict[int, str]:
    """Why the dry run refuses measurements, or ways to them, by their numbers from 0."""
    found: defaultdict[int, list[str]] = defaultdict(list)
    for problem in (wrong := measurement_problems(plan, robot)):
        found[int(problem.location[1])].append(problem.message)
    for obstacle in () if wrong else obstacles(plan, robot):
        found[obstacle.number].append(obstacle.message)
    return {number: "\n".join(messages) for number, messages in found.items()}


def described(measurement: Measurement) -> str:
    """Return a measurement's id, kind and axes, for readers."""
    return f"{measurement.id}: {measurement.kind}, {measurement.axes_in_words}"


class _Passage:
    """Motion and segments up to now."""

    def __init__(self, plan: Plan, robot: Robot) -> None:
        self.builder = MotionBuilder([0.0] * robot.n_joints)
        self.segments: list[Segment] = []
        self._plan = plan
        self._robot = robot
        self._place: Sequence[float] = [0.0] * robot.n_joints
        self._now = 0.0

    def warm_up(self) -> None:
        """Go round the plan's own configurations until time is up, as the sequencer does."""
        warm_up = self._plan.warm_up
        targets = cycle(end for m in self._plan.measurements for end in (m.start, m.end))
        while warm_up and self._now < warm_up.duration:
            self._go(next(targets), warm_up.fraction)
        if warm_up:
            self.segments.append(Segment("warm-up", "warm-up", 0.0, self._now))

    def travel(self, end: Sequence[float], fraction: float, words: str) -> None:
        """Go to where a measurement begins."""
        begin = self._now
        self._go(end, fraction)
        self.segments.append(Segment("travel", words, begin, self._now))

    def measure(self, measurement: Measurement, problem: str | None) -> None:
        """Carry out a measurement."""
        begin, self._now = self._now, self._now + measurement.duration
        self.builder.measure(measurement, begin)
        self.segments.append(
            Segment(
                measurement.kind, described(measurement), begin, self._now, measurement.read,
                recorded=True, problem=problem,
            )
        )  # fmt: skip

    def _go(self, end: Sequence[float], fraction: float) -> None:
        robot = self._robot
        velocity, acceleration = (
            fraction * limit for limit in (robot.velocity_limit, robot.acceleration_limit)
        )
        self.builder.travel(end, velocity, acceleration, self._now)
        self._now += travel_time(robot, self._place, end, fraction) + SETTLING
        self._place = end


def _refuse_endless(plan: Plan) -> None:
    """Refuse more knots than a page can hold, before they are computed."""
    least = sum(_knots(measurement) for measurement in plan.measurements)
    rounds = plan.warm_up.duration / SETTLING if plan.warm_up else 0.0
    knots = least + 4 * len(plan.measurements[0].q) * (rounds + len(plan.measurements))
    if knots > MOST_KNOTS:
        raise InvalidValue(
            f"a page of this plan would have {knots:.3g} corners of strokes, at most"
            f" {MOST_KNOTS:.3g} can be shown; lower cycles, exercise or warm_up, or divide the plan"
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
