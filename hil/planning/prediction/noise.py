"""Expected disturbances of the torques, before the measurement.

Two disturbances count. Torque readings scatter from sample to sample (current sensors, current
loop, resolution): white noise. And friction changes slowly during a measurement; the part not
covered by the estimator's friction terms is small but persistent, so it does not average out like
white noise. It is modelled as a random walk of the friction level.

Both may be stated in the robot file, `torque_noise` and `friction_wander`. Otherwise they are the
defaults stated here, or estimates from an earlier run (`hil.estimation.noise_levels`).

A third disturbance is encoder rounding. Accelerations are second differences of rounded positions,
and inertia times acceleration error is missing in the torque. With a gear, smoothing reduces this
error to 1 % of the remaining torque variance on the manutec-r15. On a direct drive it may dominate.
Then jerks, third differences, look like corners, so that the estimator leaves samples out
(`Differences`). The increments are in the drives file, or in the robot file as
`encoder_resolution`; if neither states them, encoder rounding is omitted, as `source` mentions. The
inertia is not known before the identification. It is assumed as the larger of the motor's inertia
and `INERTIA` of the torque limit over the acceleration limit.

Errors of the accelerations are errors in the regression's columns too, and there they do not
average out: least squares estimates inertias too small, by the ratio of the errors' mean square to
that of the accelerations. That is a bias, not included in standard deviations; its size is stated
for coarse encoders.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.friction.equation import JERK
from hil.least_squares.window import jerk_window, noise_gain, rounding_window
from hil.model.motors import motor_inertia

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot


TORQUE_NOISE = 0.0025
"""Expected standard deviation of a torque sample, as share of the torque limit."""
FRICTION_WANDER = 0.001
"""Expected change of friction in a minute, as share of the torque limit: friction of a tenth of the
limit that changes by a hundredth."""
MINUTE = 60.0
INERTIA = 0.5
"""Share of the torque limit that inertia takes at the acceleration limit; the rest is for gravity,
friction and the other axes."""


ACCELERATION = 0.4
"""Share of the acceleration limit that measurements of inertia use."""


class Differences(NamedTuple):
    """Effect of the differentiation of rounded positions on an estimate.

    Attributes
    ----------
    period : float
        Sample period [s].
    kept : ndarray, shape (n_joints,)
        Share of the samples with a noisy jerk below the threshold for corners.
    """

    period: float
    kept: Array


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Disturbances of the axes' torques.

    Attributes
    ----------
    torque : ndarray, shape (n_joints,)
        Standard deviation of a sample [N m].
    wander : ndarray, shape (n_joints,)
        Standard deviation of the change of the friction level within a minute [N m].
    source : str
        Description of the figures' source, for the operator.
    rounding : ndarray, shape (n_joints,), optional
        Standard deviation of a position, by the encoder's increments [rad].
    inertia : ndarray, shape (n_joints,), or 0
        Inertia accelerated by each axis [kg m^2].
    differences : Differences, optional
        Effect of rounded positions on the estimator; see `sampled`.
    excess : ndarray, shape (n_joints,), or 0
        Variance added by rounding, relative to the variance after the low-pass.
    """

    torque: Array
    wander: Array
    source: str
    rounding: Array | None = None
    inertia: Array | float = 0.0
    differences: Differences | None = None
    excess: Array | float = 0.0

    @property
    def white(self) -> Array:
        """Variance of a torque sample, shape (n_joints,) [(N m)^2]."""
        return self.torque**2

    def lost(self, robot: Robot, period: float) -> Array:
        """Compute the relative bias of an inertia by acceleration errors, shape (n_joints,).

        An axis is assumed to accelerate by `ACCELERATION` of its limit half of the time.
        """
        if self.rounding is None:
            return np.zeros_like(self.torque)
        error = self.rounding**2 * float(np.sum(rounding_window(period) ** 2))
        square = (ACCELERATION * robot.acceleration_limit) ** 2 / 2
        return error / (error + square)

    @property
    def variance(self) -> Array:
        """Variance for weighting an axis in the estimator, shape (n_joints,) [(N m)^2]."""
        return self.white * (1.0 + self.excess)

    @property
    def acceleration_variance(self) -> Array:
        """Variance of a position times the inertia squared, shape (n_joints,) [(rad kg m^2)^2]."""
        std = np.zeros_like(self.torque) if self.rounding is None else self.rounding * self.inertia
        return std**2

    def sampled(self, robot: Robot, period: float) -> Noise:
        """Return the noise at a sample period [s], with the effect of rounded positions."""
        if self.rounding is None:
            return self
        left = self.acceleration_variance * float(np.sum(rounding_window(period) ** 2))
        jerk = self.rounding * float(np.linalg.norm(jerk_window(period)))
        bound = JERK * robot.acceleration_limit / (jerk * math.sqrt(2.0))
        kept = np.array([math.erf(each) for each in bound])
        excess = left / (self.white * noise_gain(period))
        source, axes = self.source, np.flatnonzero(excess > 1.0)
        if axes.size:
            lost = 100 * self.lost(robot, period)
            named = ", ".join(str(axis + 1) for axis in axes)
            shares = ", ".join(f"{lost[axis]:.2g}" for axis in axes)
            source += (
                f"; axis {named}: encoder resolution causes more noise than the torque signal and "
                f"makes inertias about {shares} % too small; standard deviations do not include "
                "this bias"
            )
        return replace(self, differences=Differences(period, kept), excess=excess, source=source)

    def mean(self, n: int) -> Noise:
        """Return the noise of means of `n` samples."""
        return replace(self, torque=self.torque / math.sqrt(n))

    @property
    def walk(self) -> Array:
        """Growth rate of the variance of the friction level, shape (n_joints,) [(N m)^2/s]."""
        return self.wander**2 / MINUTE


def stated_noise(
    robot: Robot,
    resolution: Sequence[float] | None = None,
    increments: Sequence[float] | None = None,
) -> Noise:
    """Return the noise stated in the robot file, or default expectations.

    Parameters
    ----------
    resolution : sequence (n_joints,), optional
        Smallest step of each axis's torque reading [N m].
    increments : sequence (n_joints,), optional
        Smallest step of each axis's position [rad]; by default as the robot file states it.
    """
    joints, limit = robot.file.joints, robot.torque_limit
    torques, wanders = [j.torque_noise for j in joints], [j.friction_wander for j in joints]
    steps = np.zeros(len(joints)) if resolution is None else np.asarray(resolution, float)
    torque = np.hypot(_or(torques, TORQUE_NOISE * limit), steps / np.sqrt(12.0))
    wander = _or(wanders, FRICTION_WANDER * limit)
    stated = [value is not None for value in torques + wanders]
    source = (
        f"expected noise: torque {TORQUE_NOISE:.2%} of the torque limit, wander of friction "
        f"{FRICTION_WANDER:.1%} of the torque limit per minute"
    )
    if all(stated):
        source = "noise as stated in the robot file"
    elif any(stated):
        source = f"{source}, where not stated in the robot file"
    rounded = 2 * np.pi / (robot.encoder_resolution * robot.gear_ratio)
    if increments is not None:
        rounded = np.abs(np.asarray(increments, float))
    elif np.isnan(rounded).any():
        return Noise(
            torque, wander, f"{source}; encoder resolution not stated: its noise is left out"
        )
    of_limits = INERTIA * robot.torque_limit / robot.acceleration_limit
    # inertia accelerated by every axis [kg m^2]
    inertia = np.maximum(of_limits, np.diag(motor_inertia(robot, robot.q_min)))
    return Noise(torque, wander, source, rounded / np.sqrt(12.0), inertia)


def _or(stated: Sequence[float | None], expected: Array) -> Array:
    """Return the stated value of each axis, or the expected value if none is stated."""
    return np.array([e if s is None else s for s, e in zip(stated, expected, strict=True)])
