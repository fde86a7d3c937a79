"""Lag of axes behind the set-points of a trajectory, compared with the drives' windows.

At constant speed an axis lags by the speed times a delay: the drive's interpolation from one
set-point to the next, and one over the gain of its position loop unless it feeds the velocity
forward. A drive faults if the following error exceeds its window (6065) for longer than its timeout
(6066). The corridor that the driver checks has the same width.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory

MARGIN = 0.7
"""Share of the window available to the lag in a planned trajectory; torques and friction took up to
0.2 more on the manutec-r15."""
SAMPLES = 2000
"""Number of instants per period at which lags are evaluated."""


class Following(NamedTuple):
    """Following error limits and following delay of the axes.

    Attributes
    ----------
    window, time : ndarray, shape (n_joints,)
        Largest following error [rad or m], and its permitted duration [s].
    lag : ndarray, shape (n_joints,)
        Delay of the axes behind their set-points [s].
    """

    window: Array
    time: Array
    lag: Array

    @property
    def speed(self) -> Array:
        """Highest speeds within the margin [rad/s or m/s]."""
        return MARGIN * self.window / self.lag


class Lag(NamedTuple):
    """Largest lag of a trajectory relative to the window: axis from 0, lag and window."""

    trajectory: str
    axis: int
    most: float
    window: float


def find_largest_lag(trajectory: Trajectory, following: Following) -> Lag:
    """Return the axis with the largest lag relative to the window."""
    most = _lags(trajectory, following).max(axis=0)
    axis = int((most / following.window).argmax())
    return Lag(trajectory.id, axis, float(most[axis]), float(following.window[axis]))


def check_lag(trajectory: Trajectory, robot: Robot, following: Following) -> Iterator[str]:
    """Yield axes with a following error beyond the drive's window for longer than the timeout."""
    lags = _lags(trajectory, following)
    for axis, (window, time) in enumerate(zip(following.window, following.time, strict=True)):
        lasts = _longest(lags[:, axis] > window) * trajectory.period / SAMPLES
        if lasts > time:
            unit, most = robot.position_unit(axis), float(lags[:, axis].max())
            yield (
                f"{trajectory.id}: axis {axis + 1} lags {most:.3g} {unit} behind its set-points,"
                f" and for {lasts:.2g} s by more than its drive allows, {window:g} {unit} (6065)"
                f" for {time:g} s (6066); plan a slower trajectory, or state a wider"
                " following_error_window in the drives file"
            )


def _lags(trajectory: Trajectory, following: Following) -> Array:
    t = np.linspace(0.0, trajectory.period, SAMPLES, endpoint=False)
    return np.abs(trajectory.motion(t)[1]) * following.lag


def _longest(beyond: Array) -> int:
    """Return the longest run of samples in a periodic sequence."""
    if beyond.all():
        return len(beyond)
    runs = np.diff(np.flatnonzero(~np.concatenate([beyond, beyond])))
    return int(runs.max()) - 1 if len(runs) else 0
