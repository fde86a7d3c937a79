"""Motion history of the axes during a run, on which friction depends.

The mean speed during a recording is the distance divided by the duration. Nothing is sampled
between recordings, but the plan is known: a rest, an exercise of a known duration, and travels
between known positions.

If the first trajectory begins later than `COLD` after the bus was entered, the axes have moved
before, in repeated attempts: nothing else takes as long.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from hil.friction.warmth import History
from hil.planning.strokes import TURN
from hil.planning.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion


COLD = 60.0
"""Longest time from entering the bus to the first sample of a cold start [s]; travels and switching
on take less (`hil run` uses it, too)."""


class Positions(Protocol):
    """Positions of the axes over time: a recording or signals."""

    @property
    def time(self) -> Array:
        """Time, shape (n,) [s]."""

    @property
    def q(self) -> Array:
        """Positions, shape (n, n_joints) [rad or m]."""


def history(robot: Robot, recorded: Iterable[tuple[RecordedMotion, Positions]]) -> History:
    """Put together the history of a run, in the order of measurement."""
    in_time = sorted(recorded, key=lambda pair: float(pair[1].time[0]))
    begin = float(in_time[0][1].time[0]) if in_time else 0.0
    ends, speeds = [], []
    last_time, last_q = begin, in_time[0][1].q[0] if in_time else np.zeros(robot.n_joints)
    if begin > COLD and isinstance(in_time[0][0], Trajectory):
        ends.append(begin)
        speeds.append(_mean_speed(robot, in_time[0][1]))
        begin = 0.0
    for measurement, recording in in_time:
        first = float(recording.time[0])
        exercise, speed = _exercise(measurement, robot)
        exercise = min(exercise, first - last_time)
        idle = first - exercise - last_time
        way = np.abs(np.nan_to_num(recording.q[0] - last_q))
        if idle > 0:
            ends.append(first - exercise)
            speeds.append(way / idle / robot.velocity_limit)
        if exercise > 0:
            ends.append(first)
            speeds.append(speed)
        ends.append(float(recording.time[-1]))
        speeds.append(_mean_speed(robot, recording))
        last_time, last_q = ends[-1], recording.q[-1]
    return History(np.array(ends), np.array(speeds).reshape(len(ends), robot.n_joints), begin)


def _mean_speed(robot: Robot, way: Positions) -> Array:
    """Compute the mean speed as shares of the velocity limits, shape (n_joints,)."""
    steps = np.abs(np.nan_to_num(np.diff(way.q, axis=0))).sum(axis=0)
    duration = max(float(way.time[-1] - way.time[0]), 1e-9)
    return np.asarray(steps / duration / robot.velocity_limit)


def _exercise(measurement: RecordedMotion, robot: Robot) -> tuple[float, Array]:
    """Return duration [s] and speeds (shares of limits) of a friction measurement's exercise."""
    speed = np.zeros(robot.n_joints)
    if measurement.streamed or not measurement.exercised:
        return 0.0, speed
    i = measurement.index
    mean = measurement.stroke / (measurement.profile(0).duration + TURN)
    speed[i] = mean / float(robot.velocity_limit[i])
    return measurement.exercised, speed
