"""How long things take: travels between configurations, measurements, a whole plan.

Used by the dry run, which states it beforehand, and by the sequencer, which states what is left.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.trapezoid import Trapezoid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan


SETTLING = 0.3
"""Expected time from the end of a travel's profile until all axes stand still [s]."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the timetable: a measurement and the travel that leads to it [s]."""

    measurement: Measurement
    travel: float
    duration: float


def travel_time(
    robot: Robot, start: Sequence[float], end: Sequence[float], fraction: float
) -> float:
    """Duration of moving all axes at once from `start` to `end` [s].

    Parameters
    ----------
    start, end : sequence (n_joints,)
        Configurations [rad].
    fraction : float
        Share of each axis's velocity and acceleration limits.
    """
    return max(
        Trapezoid(a, b, fraction * float(v), fraction * float(acc)).duration
        for a, b, v, acc in zip(
            start, end, robot.velocity_limit, robot.acceleration_limit, strict=True
        )
    )


def travel_times(robot: Robot, start: Array, ends: Array, fraction: float) -> Array:
    """Duration of moving all axes at once from `start` to each of `ends` [s].

    As `travel_time`, for many at a time; shape (n,).
    """
    velocity, acceleration = fraction * robot.velocity_limit, fraction * robot.acceleration_limit
    way = np.abs(ends - start)
    peak = np.minimum(velocity, np.sqrt(way * acceleration))
    moving = way > 0
    durations = np.divide(way, peak, out=np.zeros_like(way), where=moving) + peak / acceleration
    longest: Array = durations.max(axis=1)
    return longest


def timetable(
    plan: Plan,
    robot: Robot,
    measurements: Sequence[Measurement],
    start: Sequence[float] | None = None,
) -> list[Entry]:
    """Timetable of `measurements`, in order.

    Parameters
    ----------
    start : sequence (n_joints,), optional
        Where the robot stands [rad]; all joints at 0 where it is not known.
    """
    entries = []
    place: Sequence[float] = start if start is not None else [0.0] * robot.n_joints
    for measurement in measurements:
        travel = travel_time(robot, place, measurement.start, plan.travel) + SETTLING
        entries.append(Entry(measurement, travel, measurement.duration))
        place = measurement.start
    return entries
