"""What disturbs the torques, as far as one can know before measuring.

Two things count. The torque as it is read scatters from sample to sample (current sensors, current
loop, the torque's resolution): white noise. And friction changes by itself while one measures; what
the estimator's terms for friction leave of that is small, but it lasts, so it does not average out
as white noise does. It is described as a random walk of the friction level.

Both stand in the robot file if somebody knows them, `torque_noise` and `friction_wander`. Else they
are expectations, stated here, or learnt from an earlier run (`hil.estimation.noise_levels`).

The increments of encoders are left out: differentiating makes noise of high frequency of them, of
which the smoothing leaves 1 % of the variance of the rest on the manutec-r15.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.model.robot import Robot

    Array = NDArray[np.float64]

TORQUE_NOISE = 0.0025
"""Expected standard deviation of a sample, as share of the torque limit."""
FRICTION_WANDER = 0.001
"""Expected change of friction in a minute, as share of the torque limit: friction of a tenth of the
limit that changes by a hundredth."""
MINUTE = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """What disturbs the torque of each axis.

    Attributes
    ----------
    torque : ndarray, shape (n_joints,)
        Standard deviation of a sample [N m].
    wander : ndarray, shape (n_joints,)
        Standard deviation of the change of the friction level within a minute [N m].
    source : str
        Where the figures come from, in words for the operator.
    """

    torque: Array
    wander: Array
    source: str

    @property
    def white(self) -> Array:
        """Variance of a sample, shape (n_joints,) [(N m)^2]."""
        return self.torque**2

    @property
    def walk(self) -> Array:
        """Growth of the variance of the friction level, shape (n_joints,) [(N m)^2/s]."""
        return self.wander**2 / MINUTE


def stated_noise(robot: Robot, resolution: Sequence[float] | None = None) -> Noise:
    """Noise as the robot file states it, or as expected where it does not.

    Parameters
    ----------
    robot : Robot
    resolution : sequence (n_joints,), optional
        Smallest step of each axis's torque reading [N m].
    """
    joints, limit = robot.file.joints, robot.torque_limit
    torques, wanders = [j.torque_noise for j in joints], [j.friction_wander for j in joints]
    steps = np.zeros(len(joints)) if resolution is None else np.asarray(resolution, float)
    torque = np.hypot(_or(torques, TORQUE_NOISE * limit), steps / np.sqrt(12.0))
    wander = _or(wanders, FRICTION_WANDER * limit)
    return Noise(torque, wander, _source([value is not None for value in torques + wanders]))


def _or(stated: Sequence[float | None], expected: Array) -> Array:
    """What is stated, or else expected, of each axis."""
    return np.array([e if s is None else s for s, e in zip(stated, expected, strict=True)])


def _source(stated: Sequence[bool]) -> str:
    if all(stated):
        return "noise as the robot file states it"
    expected = (
        f"noise expected: {TORQUE_NOISE:.2%} of the torque limit, friction that wanders by"
        f" {FRICTION_WANDER:.1%} of it in a minute"
    )
    return f"{expected}, where the robot file states none" if any(stated) else expected
