"""Timetable: duration of travels, measurements and whole plans.

The dry run uses it for the total, the sequencer for the remaining time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan


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
    """Simultaneous trapezoids of all axes, as functions of time.

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
