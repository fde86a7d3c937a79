"""Travels and measurements of a plan: duration, and clearance from the forbidden boxes.

The dry run uses the timetable for the total, the sequencer for the remaining time.

The sweep of a measurement is the stroke of its axis; with a partner, the rectangle of both strokes.
A travel moves all axes at once, each with a trapezoid of its own duration; the axes may start up to
`SKEW` apart, since each drive begins when it has taken its set-point. The robot's configuration
before the first travel is only known at run time, so the sequencer checks every travel again before
commanding it (`refuse_travel`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import LimitExceeded
from hil.model.capsules import capsules
from hil.planning.workspace import find_hits

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Indices
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan
    from hil.planning.workspace import Hit, Workspace


SKEW = 0.02
"""Maximum time between the starts of axes commanded together [s]."""
SETTLING = 0.3
"""Expected time from the end of a travel's profile to standstill of all axes [s]."""


@dataclass(frozen=True, slots=True)
class Entry:
    """Line of the timetable: a measurement and the preceding travel [s]."""

    measurement: Measurement
    travel: float
    duration: float


class Travels:
    """Simultaneous trapezoids of the axes, as functions of time.

    Parameters
    ----------
    start, end : array (n, n_joints)
        Start and end of each travel [rad or m].
    velocity, acceleration : array (n_joints,)
        Limits of the axes in the travels [rad/s, rad/s^2].
    """

    slack = SKEW

    def __init__(self, start: Array, end: Array, velocity: Array, acceleration: Array) -> None:
        self._start = start
        self._way = end - start
        self._acceleration = acceleration
        distance = np.abs(self._way)
        self._peak = np.minimum(velocity, np.sqrt(distance * acceleration))
        self._ramp = self._peak / acceleration
        cruise = np.divide(distance, self._peak, out=np.zeros_like(distance), where=self._peak > 0)
        self._duration = cruise + self._ramp
        self.high = self._duration.max(axis=1, keepdims=True)
        self.low = np.zeros_like(self.high)

    def configurations(self, owner: Indices, parameters: Array) -> Array:
        """Return configurations at times (n, 1) since the set-points [s]."""
        duration, ramp = self._duration[owner], self._ramp[owner]
        t = np.clip(parameters, 0.0, duration)
        rising, falling = np.minimum(t, ramp), np.maximum(t - duration + ramp, 0.0)
        way = self._acceleration * (rising**2 - falling**2) / 2 + self._peak[owner] * (t - rising)
        return np.asarray(self._start[owner] + np.sign(self._way[owner]) * way)


def travels(start: Array, end: Array, fraction: float, robot: Robot) -> Travels:
    """Create travels between configurations (n, n_joints) at a share of the robot's limits."""
    return Travels(start, end, fraction * robot.velocity_limit, fraction * robot.acceleration_limit)


def travel_time(
    robot: Robot, start: Sequence[float], end: Sequence[float], fraction: float
) -> float:
    """Compute the duration of a travel of all axes at once from `start` to `end` [s].

    Parameters
    ----------
    start, end : sequence (n_joints,)
        Configurations [rad].
    fraction : float
        Share of each axis's velocity and acceleration limits.
    """
    return float(travel_times(robot, np.array(start), np.array([end]), fraction)[0])


def travel_times(robot: Robot, start: Array, ends: Array, fraction: float) -> Array:
    """Compute the durations of travels from `start` to each of `ends`, shape (n,) [s]."""
    return np.asarray(travels(start, ends, fraction, robot).high[:, 0])


def timetable(
    plan: Plan,
    robot: Robot,
    measurements: Sequence[Measurement],
    start: Sequence[float] | None = None,
) -> list[Entry]:
    """Compute the timetable of `measurements` in order.

    Parameters
    ----------
    start : sequence (n_joints,), optional
        Present configuration [rad]; all joints at 0 by default.
    """
    entries = []
    place: Sequence[float] = start if start is not None else [0.0] * robot.n_joints
    for measurement in measurements:
        travel = travel_time(robot, place, measurement.start, plan.travel) + SETTLING
        entries.append(Entry(measurement, travel, measurement.duration))
        place = measurement.start
    return entries


_IN_A_PLAN = (
    "plan again with --workspace, choose another configuration or order, or correct box or capsule"
)
_AT_THE_START = "correct box or capsule, or move the arm away with hil drives jog"


class JointBoxes:
    """Boxes in joint space, spanned by two configurations (n, n_joints) [rad or m]."""

    slack = 0.0

    def __init__(self, start: Array, end: Array) -> None:
        self.low = np.minimum(start, end)
        self.high = np.maximum(start, end)

    def configurations(self, owner: Indices, parameters: Array) -> Array:
        """Return the parameters, which are joint coordinates."""
        del owner
        return parameters


def obstacles(plan: Plan, robot: Robot) -> Iterator[tuple[int, str]]:
    """Yield the paths of `plan` too close to a box of the workspace.

    Yields
    ------
    tuple of int and str
        Number of the measurement in the plan, from 0; path, link, box, depth and remedy.
    """
    workspace, measurements = plan.workspace, plan.measurements
    if workspace is None:
        return
    start, end = (np.array([getattr(m, at) for m in measurements]) for at in ("start", "end"))
    hits = find_hits(robot, workspace, JointBoxes(start, end))
    for number, measurement in enumerate(measurements):
        if measurement.streamed:  # joints move straight between set-points
            path = measurement.once.path(plan.sample_period)
            on_path = find_hits(robot, workspace, JointBoxes(path[:-1], path[1:])).values()
            hits |= {number: max(on_path, key=lambda hit: hit.depth)} if on_path else {}
    for number, hit in sorted(hits.items()):
        yield number, f"{measurements[number].id}: {_describe(hit, robot, workspace)}"
    ways = [("travel to", 1, start[:-1], start[1:], plan.travel)]
    if plan.warm_up:
        fraction, following = plan.warm_up.fraction, np.roll(start, -1, 0)
        ways += [("warm-up at", 0, start, end, fraction)]
        ways += [("warm-up after", 0, end, following, fraction)]
    for what, first, begins, ends, fraction in ways:
        hits = find_hits(robot, workspace, travels(begins, ends, fraction, robot))
        for number, hit in sorted(hits.items()):
            place = f"{what} {measurements[number + first].id}"
            yield number + first, f"{place}: {_describe(hit, robot, workspace)}"


def refuse_travel(
    robot: Robot,
    workspace: Workspace | None,
    start: Sequence[float],
    end: Sequence[float],
    fraction: float,
) -> None:
    """Refuse a travel too close to a box.

    Raises
    ------
    LimitExceeded
        Message with link and box; nothing has moved.
    """
    if workspace is None:
        return
    here = np.array([start])
    for hit in find_hits(robot, workspace, JointBoxes(here, here)).values():
        raise LimitExceeded(
            f"the arm is inside {workspace.boxes[hit.box].name} or too near: "
            f"{_describe(hit, robot, workspace, _AT_THE_START)}"
        )
    sweep = travels(here, np.array([end]), fraction, robot)
    for hit in find_hits(robot, workspace, sweep).values():
        where = ", ".join(f"{q:.3g}" for q in start)
        raise LimitExceeded(
            f"travel from ({where}): {_describe(hit, robot, workspace)}; move the robot closer "
            "to the next configuration with hil drives jog"
        )


def _describe(hit: Hit, robot: Robot, workspace: Workspace, remedy: str = _IN_A_PLAN) -> str:
    shapes, box = capsules(robot), workspace.boxes[hit.box]
    into = hit.depth - workspace.margin
    if into >= shapes.radii[hit.link]:
        far = f"runs right into {box.name}"
    elif into > 0:
        far = f"reaches {into:.3f} m into {box.name}"
    else:
        far = f"comes within {-into:.3f} m of {box.name}, margin {workspace.margin:g} m,"
    assumed = "" if shapes.stated[hit.link] else " (its capsule is assumed, none is stated)"
    where = ", ".join(f"{q:.3g}" for q in hit.q)
    return f"link {hit.link + 1} {far} at q = ({where}){assumed}; {remedy}"
