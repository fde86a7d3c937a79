"""Detection of pushes in the torques of moving axes, sample by sample.

Newton's law holds over every short time: the change of the axes' momentum computed from drive
torques and the model's friction, gravity and Coriolis forces differs from the change measured by
the encoders by the external momentum. Accelerations from encoders are far too noisy for single
samples, but their mean over a window is a difference of two velocities. Over a window, the mean of
the residual,

    r = tau - A(q, qd, qdd) p - H qdd - friction,

is the momentum that the drives have spent on external contact, divided by the window's length: a
push forward has r < 0. This is a momentum observer with a finite instead of a fading memory. It
needs no set-points, so it holds for every kind of motion. The acceleration of a sample needs the
next sample, the only delay.

Windows of several lengths are tested: short windows detect strong pushes soon, long windows detect
weak pushes. Each has a threshold,

    sqrt((sigmas * scatter)^2 + (2 * standard error)^2) + turning,

from the scatter of the window's means on this machine, learned without contact and tracked, from
the model's own interval (base parameters, and tracked friction, `hil.watching.friction`), and from
the possible friction error just after a reversal or a standstill (`hil.watching.friction`). At
rest, friction balances any force up to its level in either direction, so only a greater force is
visible. Before an axis has moved, its friction is unknown and no push is detected.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import Mismatch
from hil.model.dynamics import inverse_dynamics, regressor
from hil.model.motors import motor_torque
from hil.results.identified_robot import known_friction
from hil.watching.friction import FrictionLevel, FrictionTables, Turning, columns_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.results.model import Model
    from hil.results.watch import Sight

    Flags = NDArray[np.bool_]


CERTAIN = 3.0
"""Allowance for the chance error in a mean of few squares, in standard deviations."""
MEMORY, ENOUGH = 120.0, 15.0
"""Averaging time of squares, and minimum time of motion for a valid mean [s]."""


def window_lengths(period: float, seconds: float = 0.1, shortest: int = 2) -> tuple[int, ...]:
    """Return window lengths, growing by about a third from window to window [samples].

    The longest takes `seconds`, the shortest `shortest` samples.
    """
    lengths, longest = [shortest], max(round(seconds / period), shortest)
    while lengths[-1] < longest:
        lengths.append(min(max(lengths[-1] + 1, round(1.35 * lengths[-1])), longest))
    return tuple(lengths)


class Scatter:
    """Mean squares of windows of several lengths, by axis.

    Parameters
    ----------
    lengths : ndarray of int, shape (n_windows,)
        Lengths of the windows [samples].
    period : float
        Time between two samples [s].

    Attributes
    ----------
    squares : ndarray, shape (n_windows, n_joints)
        Mean squares.
    weights : ndarray, shape (n_joints,)
        Number of samples in the means, at most that of `MEMORY`.
    """

    def __init__(self, lengths: NDArray[np.int_], n_joints: int, period: float) -> None:
        self._lengths = lengths
        self.squares = np.zeros((len(lengths), n_joints))
        self.weights = np.zeros(n_joints)
        self._most, self._enough = MEMORY / period, ENOUGH / period

    @property
    def rms(self) -> Array:
        """Root mean squares, shape (n_windows, n_joints); 0 before the first sample."""
        return np.sqrt(self.squares)

    @property
    def bound(self) -> Array:
        """Upper bound of the root mean squares, shape (n_windows, n_joints).

        After a short motion, a mean of n squares of non-overlapping windows may by chance be as
        small as (1 - 2 / 9n - `CERTAIN` sqrt(2 / 9n))^3 times the true mean (Wilson and Hilferty,
        Proc. Natl. Acad. Sci. 17, 1931). If this factor is not positive, the bound is infinite.
        """
        ninths = 2 / 9 * self._lengths[:, np.newaxis] / np.maximum(self.weights, 1e-9)
        least = (1.0 - ninths - CERTAIN * np.sqrt(ninths)).clip(0.0) ** 3
        rms = np.divide(self.rms, np.sqrt(least), out=np.full_like(least, np.inf), where=least > 0)
        return np.where(self.known, self.rms, rms)

    @property
    def known(self) -> NDArray[np.bool_]:
        """Mask of axes with enough motion, shape (n_joints,)."""
        return np.asarray(self.weights >= self._enough)

    def take(self, means: Array, used: NDArray[np.bool_]) -> None:
        """Update by the windows ending at some samples.

        Parameters
        ----------
        means : ndarray, shape (n, n_windows, n_joints)
        used : ndarray of bool, shape (n, n_joints)
        """
        number = used.sum(axis=0)
        self.weights = np.minimum(self.weights + number, self._most)
        mean = np.einsum("nwj,nj->wj", means**2, used) / np.maximum(number, 1)
        share = number / np.maximum(self.weights, 1.0)
        self.squares += share * (mean - self.squares)


SLOW = 0.01
"""Share of the velocity limit below which an axis may be at rest."""
SIGMAS = 7.0
"""Threshold in standard deviations of the scatter."""
BLOCK, LASTING = 0.25, 10.0
"""Interval at which learned quantities take effect, and duration from which a deviation is learned
[s]."""
VISIBLE = 2.0
"""Largest threshold, relative to the torque limit; above it no push is visible."""
SURE = 0.05
"""Largest doubt about friction's direction of samples for learning."""
GAP = 1.5
"""Interval between samples from which on samples are missing, in periods."""


class Judged(NamedTuple):
    """Result of judging some samples.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Time of the samples that completed the judgement [s].
    measured, predicted : ndarray, shape (n, n_joints)
        Torques of the samples one period earlier [N m or N].
    outside, threshold : ndarray, shape (n, n_windows, n_joints)
        Mean external torque in each window ending at the sample, and its threshold, infinite if no
        push is visible [N m or N].
    band : ndarray, of the same shape
        Half-width of the band about 0 that contains 95 % of the means without contact [N m or N].
    moving : ndarray of bool, shape (n, n_joints)
    """

    time: Array
    measured: Array
    predicted: Array
    outside: Array
    threshold: Array
    band: Array
    moving: Flags

    def after(self, first: int) -> Judged:
        """Return the result without the first samples."""
        return Judged(*(values[first:] for values in self))  # type: ignore[arg-type]


class _Learned(NamedTuple):
    """Results of a block for later learning; arrays as in `Judged`, relative to the limits."""

    columns: Array
    left: Array
    means: Array
    doubtful: Flags
    sure: Flags


class Detector:
    """Detector of samples in order, in any block size with equal results.

    Parameters
    ----------
    model : Model
        Model with a friction law.
    period : float
        Time between two samples [s].

    Attributes
    ----------
    windows : ndarray of int, shape (n_windows,)
        Lengths of the windows [samples].
    tables, level, turning, scatter
        Parts of the prediction and of the thresholds.
    n_block : int
        Number of samples in a block.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """

    def __init__(self, model: Model, period: float) -> None:
        robot, n = model.robot, model.robot.n_joints
        self.windows = np.array(window_lengths(period))
        self._model, self._period = model, period
        self._limit, self._speed = robot.torque_limit, robot.velocity_limit
        self.tables = FrictionTables(model)
        self.level = FrictionLevel(self.tables.uncertainty, self.tables.slowest / self._speed)
        axes = known_friction(model).axes
        self.turning = Turning(
            np.array([0.0 if axis is None else axis.presliding for axis in axes]), period
        )
        self.scatter = Scatter(self.windows, n, period)
        self._recent = np.zeros((2, self.windows[-1], n))
        self._time, self._q, self._tau = np.empty(0), np.empty((0, n)), np.empty((0, n))
        self._since = 0
        self._learned: list[_Learned] = []
        self.n_block, self._in_block = max(1, round(BLOCK / period)), 0
        self._doubted = np.zeros(n)

    @property
    def distance(self) -> Array:
        """Presliding distances in use, shape (n_joints,) [rad or m]."""
        return self.turning.distance

    def begin(self, learned: Sequence[Sight]) -> None:
        """Begin with the thresholds of an earlier watch, instead of unknown scatter.

        Raises
        ------
        Mismatch
            Thresholds of another number of axes, windows or presliding distances.
        """
        n_windows, n_axes = self.scatter.squares.shape
        n_sums, n_distances, _ = self.turning.sums.shape
        for axis in learned:
            sizes = len(axis.scatter), *map(len, axis.reversals)
            if sizes != (n_windows, *n_sums * [n_distances]):
                raise Mismatch(
                    f"axis {axis.axis}: thresholds of {sizes[0]} windows and {sizes[1:]} sums for"
                    f" reversals must be {n_windows} and {n_sums} times {n_distances}; watch again"
                )
        if len(learned) != n_axes:
            raise Mismatch(f"thresholds of {len(learned)} axes must be {n_axes}; watch again")
        rms = np.array([axis.scatter for axis in learned]).T / self._limit
        self.scatter.squares = rms**2
        self.scatter.weights = np.array([axis.moved for axis in learned]) / self._period
        self.turning.sums = np.array([axis.reversals for axis in learned]).transpose(1, 2, 0)
        self.turning.settle()

    def take(self, time: Array, q: Array, tau: Array) -> Iterator[Judged]:
        """Judge further samples.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Time [s].
        q, tau : ndarray, shape (n, n_joints)
            Positions and torques [rad or m, N m or N]; NaN is a gap.

        Yields
        ------
        Judged
            Judged samples in order, except before a full window and after a gap.
        """
        there = np.isfinite(q).all(axis=1) & np.isfinite(tau).all(axis=1)
        time, q, tau = time[there], q[there], tau[there]
        last = self._time[-1:] if len(self._time) else time[:1]
        gaps = np.flatnonzero(np.diff(time, prepend=last) > GAP * self._period)
        for begin, end in pairwise((0, *gaps, len(time))):
            if begin in gaps:
                self._time, self._since = self._time[:0], 0
            part = slice(begin, end)
            yield from self._go_on(time[part], q[part], tau[part])

    def _go_on(self, time: Array, q: Array, tau: Array) -> Iterator[Judged]:
        """Judge successive samples, together with the last two."""
        kept = slice(len(self._q) - len(self._time), None)
        time = np.concatenate([self._time, time])
        q, tau = np.concatenate([self._q[kept], q]), np.concatenate([self._tau[kept], tau])
        self._time, self._q, self._tau = time[-2:], q[-2:], tau[-2:]
        begin, last = 1, len(time) - 1
        while begin < last:
            end = min(last, begin + self.n_block - self._in_block)
            rows = slice(begin - 1, end + 1)
            judged = self._judge(time[begin + 1 : end + 1], q[rows], tau[begin:end])
            skipped = min(max(self.windows[-1] - 1 - self._since, 0), end - begin)
            self._since += end - begin
            self._in_block = (self._in_block + end - begin) % self.n_block
            if self._in_block == 0:
                self._learn()
            if skipped < end - begin:
                yield judged.after(skipped)
            begin = end

    def _judge(self, time: Array, q: Array, measured: Array) -> Judged:
        robot, period = self._model.robot, self._period
        step = np.diff(q, axis=0)
        qd, qdd = (step[1:] + step[:-1]) / (2 * period), np.diff(step, axis=0) / period**2
        q = q[1:-1]
        rigid = inverse_dynamics(robot, self._model.values, q, qd, qdd)
        offset, level = self.tables.evaluate(qd, rigid)
        frictionless = rigid + motor_torque(robot, q, qd, qdd) + offset
        turn = self.turning.take(step[:-1], qd, measured - frictionless, level)
        speed = np.abs(qd) / self._speed
        columns = columns_of(turn.direction, level / self._limit, speed)
        drifted, spread = self.level.evaluate(columns)
        predicted = frictionless + turn.direction * level + turn.damping + drifted * self._limit
        left = (measured - predicted) / self._limit
        rest = np.clip(1.0 - speed / SLOW, 0.0, 1.0) * (1.0 + np.abs(turn.direction))
        wrong = np.maximum(turn.doubt, rest)
        means, bands = self._windows(left, wrong * level / self._limit)
        # the relative torque variance from base parameters, at constant speed
        A = regressor(robot, q, qd, np.zeros_like(qd))
        variance = np.einsum("njk,njk->nj", A @ self._model.covariance, A)
        error = 4 * (spread**2 + variance.clip(0.0) / self._limit**2)[:, np.newaxis]
        scatter = self.scatter.bound
        # standard deviations for the alarm threshold, and for the displayed 95 % band
        threshold, band = (
            np.sqrt((sigmas * scatter) ** 2 + error) + bands for sigmas in (SIGMAS, 1.96)
        )
        threshold[threshold > VISIBLE] = np.inf
        moving = speed > SLOW
        doubtful: Flags = np.asarray(np.any(np.abs(means) > threshold, axis=1))
        sure = moving & (turn.doubt < SURE)
        self._learned.append(_Learned(columns, left, means, doubtful, sure))
        shown = (-means * self._limit, threshold * self._limit, band * self._limit)
        return Judged(time, measured, predicted, *shown, moving)

    def _windows(self, left: Array, band: Array) -> tuple[Array, Array]:
        """Compute means over windows ending at the samples, shape (n, n_windows, n_joints)."""
        longest = self.windows[-1]
        rows = np.concatenate([self._recent, np.stack([left, band])], axis=1)
        self._recent = rows[:, -longest:]
        sums = np.concatenate([np.zeros_like(rows[:, :1]), rows.cumsum(axis=1)], axis=1)
        ends = np.arange(longest + 1, rows.shape[1] + 1)[:, np.newaxis]
        means = (sums[:, ends] - sums[:, ends - self.windows]) / self.windows[:, np.newaxis]
        return means[0], means[1]

    def _learn(self, longest: float = LASTING) -> None:
        """Learn from the results of a block.

        A deviation that lasts `longest` [s] is learned as well: a load, or changed friction.
        """
        shown = [np.concatenate(values) for values in zip(*self._learned, strict=True)]
        columns, left, means, doubtful, sure = shown
        self._learned.clear()
        duration = len(left) * self._period
        # without a known scatter every block would be doubtful, and only the quietest would be used
        doubted = doubtful.any(axis=0) & self.scatter.known
        self._doubted = np.where(doubted, self._doubted + duration, 0.0)
        trusted = (self._doubted == 0) | (self._doubted > longest)
        self.turning.settle(trusted)
        if self._since < self.windows[-1] + len(left):
            return
        used = sure & trusted
        self.scatter.take(means, used)
        self.level.follow(columns, left, used, duration)
