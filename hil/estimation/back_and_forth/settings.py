"""Cut-off frequency of each recording, and speeds, chosen from the axis that moves.

The rule is that of free motions (`hil.estimation.free_motion.settings`), recording by recording:
slow strokes over few increments deserve a lower one than fast ones. Half-sums over bins take noise
off by themselves, so torque and columns keep what positions keep: the narrower the low-pass, the
further a reversal of friction reaches into a stroke.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.motion import Processing
from hil.estimation.free_motion.settings import bandwidth, cut_off_of
from hil.estimation.free_motion.survey import OFTEN

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.free_motion import FreeMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

SPAN = 0.02
"""Over which speeds are means [s]."""


def speed_of(recording: Recording, axis: int) -> float:
    """Speed of the strokes of an axis that few samples exceed [rad/s or m/s]."""
    every = max(1, min(round(SPAN / recording.period), recording.n_samples // 20))
    way = np.abs(recording.q[every:, axis] - recording.q[:-every, axis])
    return max(float(np.quantile(way, OFTEN)) / (every * recording.period), 1e-9)


def speeds_of(robot: Robot, motions: Iterable[tuple[FreeMotion, Recording]]) -> Array:
    """Greatest speed of each axis that is moved, 1 of others, shape (n_joints,)."""
    found = np.zeros(robot.n_joints)
    for motion, recording in motions:
        (axis,) = motion.moved
        found[axis] = max(found[axis], speed_of(recording, axis))
    return np.where(found > 0, found, 1.0)


def processing_of_strokes(motion: FreeMotion, recording: Recording) -> tuple[Processing, str]:
    """Settings of one recording, and why its cut-off is what it is."""
    (axis,) = motion.moved
    width = bandwidth(recording.q[:, axis], recording.period)
    cut_off, reason = cut_off_of([width], recording.period, motion.cut_off)
    speed = np.ones(recording.n_joints)
    speed[axis] = speed_of(recording, axis)
    derived = np.zeros(recording.n_joints, dtype=bool)
    none = np.zeros(recording.n_joints)
    return Processing(cut_off, cut_off, speed, derived, none, none), reason
