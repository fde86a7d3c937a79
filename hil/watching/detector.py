"""Finds pushes in the torques of moving axes, sample by sample.

Newton's law holds within every short time: what the drives and the model's friction, gravity and
Coriolis forces have done to the momentum of the axes, and what has become of it by the encoders,
differ by what somebody else has done. Accelerations from encoders are far too noisy to be looked at
one by one, but their mean over a window is a difference of two velocities, and with it the mean of
what is left,

    r = tau - A(q, qd, qdd) p - H qdd - friction,

is the momentum that came from outside over the window's length. That is what an observer of the
momentum integrates, over a finite time instead of a fading one. It needs no set-points, so it holds
for every kind of motion. The acceleration of a sample takes the next one, which is all the delay
there is.

Windows of several lengths are looked at: short ones see strong pushes soon, long ones weak pushes.
Each has a threshold,

    sqrt((SIGMAS * scatter)^2 + (2 * standard error)^2) + turning,

from how such means scatter on this machine (`hil.watching.scatter`), from the model's own interval
(base parameters, and friction as it is followed, `hil.watching.friction_level`), and from what
friction's direction may be wrong by just after a reversal (`hil.watching.turning`). At rest
friction holds against anything up to its level in either direction, so only more than that is seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.model.dynamics import inverse_dynamics, regressor
from hil.model.motors import motor_torque
from hil.watching.friction_level import FrictionLevel, columns_of
from hil.watching.friction_tables import FrictionTables
from hil.watching.scatter import Scatter, window_lengths
from hil.watching.turning import Turning

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drivers.drive_bus import Sample
    from hil.results.model import Model

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]

SIGMAS = 7.0
BLOCK = 0.25
"""Time after which friction is followed by a step [s]."""
LOOK = 0.064
"""Time after which the uncertainty of the base parameters' torque is found anew [s]."""
SLOW = 0.01
"""Share of the velocity limit below which an axis may be at rest."""
SURE = 0.05
"""Doubt of friction's direction up to which a sample shows how friction and scatter are."""
DOUBTFUL = 0.7
"""Share of a threshold above which nothing is learned from a sample."""
LONGEST_DOUBT = 10.0
"""Time after which what lasts is learned all the same: a load, or friction that has changed [s]."""


class Judged(NamedTuple):
    """What one sample shows.

    Attributes
    ----------
    time : float
        Of the sample with which it was known [s].
    measured, predicted : ndarray, shape (n_joints,)
        Of the sample before [N m or N].
    outside, threshold : ndarray, shape (n_windows, n_joints)
        Mean torque from outside in each window that ends with that sample, and the threshold of its
        size [N m or N].
    moving : ndarray of bool, shape (n_joints,)
    """

    time: float
    measured: Array
    predicted: Array
    outside: Array
    threshold: Array
    moving: Flags


class Detector:
    """Judges samples one after the other.

    Parameters
    ----------
    model : Model
        With a law of friction.
    period : float
        Time between two samples [s].

    Attributes
    ----------
    windows : tuple of int
        Lengths of the windows [samples].

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """

    def __init__(self, model: Model, period: float) -> None:
        robot, n = model.robot, model.robot.n_joints
        self.windows = window_lengths(period)
        self._model, self._period = model, period
        self._limit, self._speed = robot.torque_limit, robot.velocity_limit
        self._tables = FrictionTables(model)
        self._level = FrictionLevel(self._tables.uncertainty)
        self._turning = Turning(_presliding(model))
        self._scatter = Scatter(len(self.windows), n, period)
        longest = self.windows[-1]
        self._means = np.array([np.arange(longest) >= longest - w for w in self.windows], float)
        self._means /= np.array(self.windows)[:, np.newaxis]
        self._recent = np.zeros((2, longest, n))
        self._motion: list[tuple[Array, Array]] = []
        self._time = 0.0
        self._since = 0
        self._columns: list[Array] = []
        self._left: list[Array] = []
        self._used: list[Flags] = []
        self._doubted = np.zeros(n)
        self._parameters = np.zeros(n)
        self._look = 0

    @property
    def distance(self) -> Array:
        """Presliding distances that are taken, shape (n_joints,) [rad or m]."""
        return self._turning.distance

    def take(self, sample: Sample) -> Judged | None:
        """Take the next sample; None where too few have come without a gap.

        Parameters
        ----------
        sample : Sample
            One with missing values is a gap.
        """
        q, tau = np.array(sample.q), np.array(sample.tau)
        if not np.isfinite(q.sum() + tau.sum()) or sample.time - self._time > 1.5 * self._period:
            self._motion.clear()
            self._since = 0
        self._time = sample.time
        if np.isfinite(q.sum() + tau.sum()):
            self._motion.append((q, tau))
        if len(self._motion) < 3:
            return None
        before, (here, measured), after = self._motion
        del self._motion[0]
        return self._judge(before[0], here, after[0], measured)

    def _judge(self, before: Array, q: Array, after: Array, measured: Array) -> Judged | None:
        step = q - before
        qd, qdd = (after - before) / (2 * self._period), (after - q - step) / self._period**2
        self._turning.take(step)
        rigid = inverse_dynamics(self._model.robot, self._model.values, q, qd, qdd)
        offset, level = self._tables.at(qd, rigid)
        frictionless = rigid + motor_torque(self._model.robot, q, qd, qdd) + offset
        speed = np.abs(qd) / self._speed
        columns = columns_of(self._turning.direction, level / self._limit, speed)
        drifted, spread = self._level.at(columns)
        predicted = frictionless + self._turning.direction * level + drifted * self._limit
        left = (measured - predicted) / self._limit
        band = self._band(level, speed)
        self._recent[:, :-1] = self._recent[:, 1:]
        self._recent[:, -1] = left, band
        self._since += 1
        self._look_at_parameters(q, qd, qdd)
        means, bands = self._means @ self._recent[0], self._means @ self._recent[1]
        noise = (SIGMAS * self._scatter.rms) ** 2 + 4 * (spread**2 + self._parameters**2)
        threshold = np.sqrt(noise) + bands
        if self._since < self.windows[-1]:
            return None
        moving = speed > SLOW
        self._learn(measured - frictionless, level, columns, left, means, threshold, moving)
        return Judged(
            self._time, measured, predicted, means * self._limit, threshold * self._limit, moving
        )

    def _band(self, level: Array, speed: Array) -> Array:
        """By what friction may be wrong while it turns round or rests, as share of the limit."""
        rest = np.clip(1.0 - speed / SLOW, 0.0, 1.0) * (1.0 + np.abs(self._turning.direction))
        return np.asarray(np.maximum(self._turning.doubt, rest) * level / self._limit)

    def _look_at_parameters(self, q: Array, qd: Array, qdd: Array) -> None:
        """Find now and then how uncertain the base parameters make the torque."""
        if self._look <= 0:
            A = regressor(self._model.robot, q, qd, 0.0 * qdd)
            variance = np.einsum("jk,jk->j", A @ self._model.covariance, A)
            self._parameters = np.sqrt(variance.clip(0.0)) / self._limit
            self._look = max(1, round(LOOK / self._period))
        self._look -= 1

    def _learn(
        self,
        friction: Array,
        level: Array,
        columns: Array,
        left: Array,
        means: Array,
        threshold: Array,
        moving: Flags,
    ) -> None:
        doubtful = (np.abs(means) > DOUBTFUL * threshold).any(axis=0)
        self._doubted = np.where(doubtful, self._doubted + self._period, 0.0)
        trusted = ~doubtful | (self._doubted > LONGEST_DOUBT)
        sure = trusted & moving & (self._turning.doubt < SURE)
        self._turning.learn(friction, level)
        self._scatter.take(means, sure)
        self._columns.append(columns)
        self._left.append(left)
        self._used.append(sure)
        if len(self._left) * self._period >= BLOCK:
            self._follow()

    def _follow(self) -> None:
        columns, left, used = map(np.array, (self._columns, self._left, self._used))
        self._level.follow(columns, left, used, len(left) * self._period)
        self._turning.settle()
        self._columns.clear()
        self._left.clear()
        self._used.clear()


def _presliding(model: Model) -> Array:
    law = model.friction_law
    assert law is not None  # noqa: S101 - refused before
    return np.array([0.0 if axis is None else axis.presliding for axis in law.axes])
