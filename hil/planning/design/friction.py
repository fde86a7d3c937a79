"""Plans for friction: speed sweeps, and the two experiments on friction changing in time.

sweep
    Constant velocity from creep to the speed limit, in both directions, one axis after the other
    (section 2, Fig. 1). Speeds are spaced evenly in their logarithm and taken in a scattered order,
    so that friction's drift meanwhile looks like scatter and not like a dependence on speed.
stops
    Continuous motion back and forth with the torque every 12 s, interrupted by stops of 5, 1 and
    2 min (Fig. 2a).
operation
    The characteristic after several times of continuous operation (Fig. 2b).

At low speed a window of constant velocity spans at least one turn of the motor, the period of
torque ripple; at high speed it lasts some tenths of a second. If an axis's range is too short for
its ramps, the acceleration is raised up to `HARDEST` of the limit. If the range is still too short,
the sweep ends below the speed limit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.design.measurable_elements import RAMP_OF_CREEP, RANGE
from hil.planning.halton import GOLDEN, halton
from hil.planning.measurement import Friction
from hil.planning.plan import make_plan
from hil.planning.strokes import TURN
from hil.planning.timetable import SETTLING, JointBoxes
from hil.planning.trapezoid import Trapezoid
from hil.planning.workspace import are_clear, narrow_ranges

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.planning.workspace import Workspace


SLOWEST = 0.003
"""Lowest speed of a sweep as a share of the limit: low enough to show a Stribeck peak."""
INTERVAL = 12.0
"""Interval between torque readings in continuous motion [s]."""
STOPS = (300.0, 60.0, 120.0)
"""Durations of the stops in continuous motion [s]."""
OPERATION = (0.0, 600.0, 1800.0, 3600.0)
"""Times of continuous operation before each characteristic [s]."""
OPERATING_SPEEDS, OPERATING_SLOWEST = 10, 0.02
"""Number of speeds in `operation`, and the lowest as a share of the limit.

Creeping would affect the gear like a rest.
"""
CONTINUOUS = 0.5
"""Share of the speed limit in continuous motion."""

EASY, HARDEST = 0.4, 0.8
"""Shares of the acceleration limit: default, and maximum for short ranges."""
WINDOW, SHORT_WINDOW = 1.0, 0.5
"""Duration of constant velocity, transient after the ramp included: desired and minimum [s]."""
CANDIDATES = 64


def sweep(
    robot: Robot,
    axes: Sequence[int] = (),
    speeds: int = 16,
    slowest: float = SLOWEST,
    workspace: Workspace | None = None,
) -> Plan:
    """Plan constant-velocity sweeps.

    Parameters
    ----------
    axes : sequence of int
        Axes from 0; none for all.
    speeds : int
        Number of speeds of each axis.
    slowest : float
        Lowest speed as share of the limit.
    workspace : Workspace, optional
        Workspace to keep clear, stored in the plan.

    Raises
    ------
    ValueError
        The range of an axis is too short, or no configuration is clear.
    """
    bench = _Bench(robot, workspace)
    measurements = []
    for axis in axes or range(robot.n_joints):
        order = _scatter(bench.speeds(axis, speeds, slowest))
        for number, velocity in enumerate(order, start=1):
            # 60 s of motion at about half the speed limit before an axis's sweep
            exercise = None if number > 1 else 60.0
            name = f"f{axis + 1}-{number:02d}"
            measurements.append(bench.measurement(name, axis, velocity, exercise=exercise))
    return make_plan(robot, measurements, workspace=workspace)


def stops(robot: Robot, axis: int, workspace: Workspace | None = None) -> Plan:
    """Plan continuous motion of an axis with `STOPS`, reading the torque every `INTERVAL`.

    Raises
    ------
    ValueError
        The range of an axis is too short, or no configuration is clear.
    """
    bench = _Bench(robot, workspace)
    velocity = CONTINUOUS * bench.top(axis)
    once = bench.measurement("once", axis, velocity, cycles=1)
    pair = 2 * (once.profile(0).duration + TURN)
    pairs = max(0, round((INTERVAL - once.duration - SETTLING) / pair))
    exercise = (pairs - 0.5) * pair if pairs else None
    # 600 s of motion before, between and after the stops
    each = max(1, round(600.0 / (pairs * pair + once.duration + SETTLING)))
    measurements: list[Friction] = []
    for rest in (None, *STOPS):
        for number in range(each):
            first = not number
            history = {"rest": rest} if first else {"exercise": exercise}
            name = f"s{axis + 1}-{len(measurements) + 1:03d}"
            measurements.append(bench.measurement(name, axis, velocity, cycles=1, **history))
    return make_plan(robot, measurements, workspace=workspace)


def operation(
    robot: Robot,
    axis: int,
    times: Sequence[float] = OPERATION,
    speeds: int = OPERATING_SPEEDS,
    workspace: Workspace | None = None,
) -> Plan:
    """Plan the friction characteristic of an axis after given times of continuous operation [s].

    Raises
    ------
    ValueError
        The range of an axis is too short, or no configuration is clear.
    """
    bench = _Bench(robot, workspace)
    measurements: list[Friction] = []
    now = 0.0
    for number, time in enumerate(sorted(times), start=1):
        for k, velocity in enumerate(_scatter(bench.speeds(axis, speeds, OPERATING_SLOWEST))):
            exercise = time - now if not k and time > now else None
            name = f"o{axis + 1}-{number}-{k + 1:02d}"
            made = bench.measurement(name, axis, velocity, exercise=exercise)
            measurements.append(made)
            now += made.duration + SETTLING
    return make_plan(robot, measurements, workspace=workspace)


class _Bench:
    """Robot and the space available per axis."""

    def __init__(self, robot: Robot, workspace: Workspace | None) -> None:
        self._robot = robot
        self._guarded = narrow_ranges(robot, workspace)
        self._workspace = workspace
        self._places: dict[int, tuple[float, ...]] = {}

    def room(self, axis: int) -> float:
        """Return the longest stroke of an axis [rad]."""
        return RANGE * float(self._guarded.q_max[axis] - self._guarded.q_min[axis])

    def top(self, axis: int) -> float:
        """Compute the highest speed that the range permits for `SHORT_WINDOW` [rad/s]."""
        hardest = HARDEST * float(self._robot.acceleration_limit[axis])
        half = SHORT_WINDOW * hardest / 2
        reachable = math.sqrt(half**2 + hardest * self.room(axis)) - half
        return min(float(self._robot.velocity_limit[axis]), reachable)

    def speeds(self, axis: int, count: int, slowest: float) -> list[float]:
        top = self.top(axis)
        low = min(slowest * float(self._robot.velocity_limit[axis]), top)
        return [float(v) for v in np.geomspace(low, top, count)]

    def measurement(
        self, name: str, axis: int, velocity: float, cycles: int = 2, **history: float | None
    ) -> Friction:
        """Create the measurement of a speed; the speeds of an axis share a configuration."""
        room = self.room(axis)
        left = room - velocity * SHORT_WINDOW
        easy = EASY * float(self._robot.acceleration_limit[axis])
        acceleration = max(min(easy, velocity / RAMP_OF_CREEP), velocity**2 / left)
        turn = math.tau / float(self._robot.gear_ratio[axis]) + velocity * (WINDOW - SHORT_WINDOW)
        ramps = Trapezoid(0.0, 1e9, velocity, acceleration).ramp * 2
        return Friction(
            id=name,
            axis=axis + 1,
            q=self._place(axis),
            stroke=min(ramps + max(velocity * WINDOW, turn), room),
            velocity=velocity,
            acceleration=acceleration,
            cycles=cycles,
            **history,
        )

    def _place(self, axis: int) -> tuple[float, ...]:
        """Return mid-range joint positions, or ones where the whole stroke is clear of boxes."""
        if axis in self._places:
            return self._places[axis]
        low, high = self._guarded.q_min, self._guarded.q_max
        middle = (low + high) / 2
        if self._workspace is None:
            return tuple(middle.tolist())
        others = [i for i in range(len(middle)) if i != axis]
        q = np.tile(middle, (CANDIDATES, 1))
        if others:
            spread = RANGE * (high - low)[others]
            points = halton(CANDIDATES - 1, len(others)) - 0.5
            q[1:, others] = middle[others] + points * spread
        reach = np.zeros(len(middle))
        reach[axis] = self.room(axis) / 2
        clear = are_clear(self._robot, self._workspace, JointBoxes(q - reach, q + reach))
        if not clear.any():
            raise ValueError(
                f"axis {axis + 1} cannot pass its range clear of the workspace's boxes; narrow"
                f" joint {axis + 1}'s range in the workspace, or make boxes or margin smaller"
            )
        self._places[axis] = tuple(q[int(clear.argmax())].tolist())
        return self._places[axis]


def _scatter(speeds: Sequence[float]) -> list[float]:
    """Order speeds without a trend, starting with about half of the highest speed."""
    half = min(speeds, key=lambda v: abs(v - CONTINUOUS * max(speeds)))
    rest = [v for v in speeds if v != half]
    order = np.argsort([k * GOLDEN % 1.0 for k in range(len(rest))], kind="stable")
    return [half, *(rest[int(k)] for k in order)]
