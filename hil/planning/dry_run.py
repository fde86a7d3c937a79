"""Dry run of a plan: problems, duration, bus load and identifiability, without bus and motion.

It answers three questions. Do all configurations, strokes and profiles keep inside the robot's
limits and outside forbidden boxes, with strokes long enough for their purpose (`Problem`)? How long
will the plan take, and how much bus load will it cause? Which parameters will it identify
(`hil.planning.prediction.identifiability`)?
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from hil.planning.measurement import axes_lacking_law, element_measurements, shows_parameters
from hil.planning.prediction.identifiability import Identifiability, identifiability
from hil.planning.timetable import obstacles, timetable
from hil.planning.trajectory import check_lag, check_trajectory, find_largest_lag
from hil.planning.workspace import narrow_ranges

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan
    from hil.planning.strokes import Partner, Strokes
    from hil.planning.trajectory import Following, Lag


@dataclass(frozen=True, slots=True)
class Problem:
    """Reason to refuse a plan.

    Attributes
    ----------
    location : tuple of str and int
        Keys of the value in the plan's file.
    message : str
        Measurement, value, bound and remedy.
    """

    location: tuple[str | int, ...]
    message: str


class BusCycle(NamedTuple):
    """Bus traffic of a SYNC cycle.

    Attributes
    ----------
    duration : float
        Time on the bus per cycle [s].
    bitrate : int
        Bit rate [bit/s].
    frames : str
        Description of the frames.
    most : float
        Largest permitted share of the bus.
    """

    duration: float
    bitrate: int
    frames: str
    most: float


@dataclass(frozen=True, slots=True)
class DryRun:
    """Result of a dry run.

    Attributes
    ----------
    counts : dict
        Measurements of each kind.
    durations : dict
        Time of each kind, of travels and of the warm-up [s].
    bus : BusCycle or None
        Bus traffic per cycle, if known.
    bus_load : float
        Share of the bus used at the sample period.
    problems : tuple of Problem
        Reasons to refuse the plan; empty for a valid plan.
    without_law : dict
        Axes, from 0, with too few measurements for a friction law, and the number of measurements;
        empty if no parameters are identified.
    lags : tuple of Lag
        Largest relative lag of each trajectory; empty if unknown.
    groups : tuple of Identifiability
        Identifiability of each group of base parameters; empty if measurements have problems, and
        for plans of friction or trajectories only.
    """

    counts: dict[str, int]
    durations: dict[str, float]
    bus: BusCycle | None
    bus_load: float
    problems: tuple[Problem, ...]
    without_law: dict[int, int]
    lags: tuple[Lag, ...]
    groups: tuple[Identifiability, ...]

    @property
    def duration(self) -> float:
        """Expected robot time in total [s]."""
        return sum(self.durations.values())


def dry_run(
    plan: Plan, robot: Robot, bus: BusCycle | None = None, following: Following | None = None
) -> DryRun:
    """Check a plan and predict duration, bus load and identifiability.

    Parameters
    ----------
    plan, robot : Plan, Robot
        The plan was made for this robot.
    bus : BusCycle, optional
        Bus traffic per cycle.
    following : Following, optional
        Following error limits and delays, to check trajectories.
    """
    of_groups = bool(element_measurements(plan.measurements))
    measurements = measurement_problems(plan, robot)
    if not measurements:
        measurements = [
            Problem(("measurements", number, "q"), message)
            for number, message in obstacles(plan, robot)
        ]
    lags = []
    for number, measurement in enumerate(plan.measurements):
        if following is not None and measurement.streamed:
            lags.append(find_largest_lag(measurement, following))
            measurements += [
                Problem(("measurements", number, "sine"), message)
                for message in check_lag(measurement, robot, following)
            ]
    problems = list(measurements)
    if bus is not None and bus.duration > bus.most * plan.sample_period:
        load, longest = bus.duration / plan.sample_period, bus.duration / bus.most
        problems.append(
            Problem(
                ("sample_period",),
                f"{plan.sample_period:g} s loads the bus with {load:.0%} at {bus.bitrate} bit/s, at"
                f" most {bus.most:.0%} allowed; sample every {math.ceil(longest * 1e4) / 1e4:g} s "
                "or use a faster bus",
            )
        )
    total: defaultdict[str, float] = defaultdict(float)
    for entry in timetable(plan, robot, plan.measurements):
        total[entry.measurement.kind] += entry.duration
        total["travel"] += entry.travel
    if plan.warm_up:
        total["warm-up"] = plan.warm_up.duration
    return DryRun(
        counts=dict(Counter(m.kind for m in plan.measurements)),
        durations=dict(total),
        bus=bus,
        bus_load=bus.duration / plan.sample_period if bus else 0.0,
        problems=tuple(problems),
        without_law=axes_lacking_law(plan.measurements, robot.n_joints)
        if any(shows_parameters(each) for each in plan.measurements)
        else {},
        lags=tuple(lags),
        groups=() if measurements or not of_groups else identifiability(plan, robot),
    )


def measurement_problems(plan: Plan, robot: Robot) -> list[Problem]:
    """Return measurements beyond the limits of `robot` or of the plan's workspace."""
    guarded = narrow_ranges(robot, plan.workspace)
    return [
        problem
        for number, measurement in enumerate(plan.measurements)
        for problem in _check(number, measurement, guarded, plan.sample_period)
    ]


def _check(number: int, measurement: Measurement, robot: Robot, period: float) -> Iterator[Problem]:
    here: tuple[str | int, ...] = ("measurements", number)
    if measurement.streamed:
        for message in check_trajectory(measurement, robot, period):
            yield Problem((*here, "sine"), message)
        return
    # check that both ends of the strokes keep inside the joint range
    ends = zip(measurement.start, measurement.end, robot.q_min, robot.q_max, strict=True)
    for index, (first, last, low, high) in enumerate(ends):
        beyond = min(first, last) if min(first, last) < low else max(first, last)
        if low <= beyond <= high:
            continue
        still, unit = first == last, robot.position_unit(index)
        stroke = "" if still else ", with half its stroke,"
        yield Problem(
            (*here, "q", index),
            f"{measurement.id}: joint {index + 1}{stroke} at {beyond:.5g} {unit} is outside"
            f" {low:.5g} ... {high:.5g} {unit};"
            f" {_remedy(unit, beyond, low, high, 'choose another configuration or stroke')}",
        )
    yield from _check_profile(here, measurement.id, measurement, robot)
    for partner in measurement.partners:
        yield from _check_profile((*here, "partner"), measurement.id, partner, robot)
    cruise, lacking = measurement.cruise, measurement.lacking
    if cruise is not None and lacking:
        unit = robot.position_unit(measurement.index)
        length = measurement.stroke + lacking * measurement.velocity
        yield Problem(
            (*here, "stroke"),
            f"{measurement.id}: {measurement.stroke:g} {unit} leaves"
            f" {cruise.duration - lacking:.3g} s of {cruise.purpose}, must be at least"
            f" {cruise.duration:.3g} s; lengthen the stroke to {length:.3g} {unit} or lower the"
            " velocity",
        )


def _check_profile(
    here: tuple[str | int, ...], where: str, moved: Strokes | Partner, robot: Robot
) -> Iterator[Problem]:
    index, unit = moved.index, robot.position_unit(moved.index)
    for key, per in (("velocity", "/s"), ("acceleration", "/s^2")):
        value, limit = getattr(moved, key), float(getattr(robot, f"{key}_limit")[index])
        if value > limit:
            yield Problem(
                (*here, key),
                f"{where}: {value:g} {unit}{per} is above the limit of joint {index + 1}, {limit:g}"
                f" {unit}{per}; {_remedy(unit, value, -limit, limit, 'plan a lower one')}",
            )


def _remedy(unit: str, value: float, low: float, high: float, remedy: str) -> str:
    """Return `remedy`, or the value in SI if the unit seems to be degrees or millimetres."""
    other, si = ("degrees", math.radians(value)) if unit == "rad" else ("millimetres", value / 1e3)
    if abs(value) > 5 * max(abs(low), abs(high)) and low <= si <= high:
        return f"is it in {other}? then write {si:.5g}"
    return remedy
