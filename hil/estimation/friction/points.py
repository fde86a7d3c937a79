"""Friction torque at one speed, symmetry, and the motion history behind friction.

Each stroke gives the mean torque T_k over its window of constant velocity. All windows of a
measurement are cut to their common angles, over whole turns of the motor, so that gravity and
torque ripple are alike in all windows and

    T_k = c + s_k (f + d t_k) + e_k,    s_k = +1 forward, -1 back,

gives the friction f, its drift d during the measurement and a common part c by least squares.
Without a gravity model, c is the mean gravity torque plus the asymmetry of friction, and f is the
half-difference of both directions at equal angles. With the parameters p_g of an identified model,
g(q) is subtracted first; then c is the asymmetry alone, and the friction torques f + c forward and
f - c back are separate.

In the motion history, the mean speed during a recording is the distance divided by the duration.
Nothing is sampled between recordings, but the plan is known: a rest, an exercise of a known
duration, and travels between known positions.

If the first trajectory begins later than `COLD` after the bus was entered, the axes have moved
before, in repeated attempts: nothing else takes as long.

Symmetry of friction in both directions is the one assumption of the two-step method. The published
method takes half the sum of both directions for the gravity torque, so a difference between the
directions becomes an error of p_g (eq. (14)). Each measurement gives this difference as a share of
the friction level, (half-sum - gravity) / half-difference. For each axis the weighted mean over the
measurements is tested against zero by Student's t. The error of the gravity model is common to all
measurements, so it is added to the standard error of the mean.

With enough data every gear is found to be asymmetric. A second p-value therefore tests the
hypothesis that the asymmetry is no larger than a bound; an axis fails only if that is improbable.
An offset of the current sensor looks exactly like asymmetry, and does the same harm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy import special

from checked_files.yaml_file import FileModel
from hil.errors import NotEnoughData
from hil.estimation.intervals import SIGNIFICANT
from hil.estimation.local_fits import SETTLING
from hil.estimation.signals import signals
from hil.friction.warmth import History
from hil.least_squares.solving import orthonormal
from hil.least_squares.uncertainty import scatter
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import gravity_torque, regressor
from hil.planning.measurement import FOR_A_LAW
from hil.planning.strokes import TURN
from hil.planning.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.local_fits import LocalValue
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import Friction, RecordedMotion
    from hil.runs.recording import Recording


BOUND = 0.02
"""Largest acceptable asymmetry, as a share of the friction level: a convention; ``hil friction
--asymmetry`` sets another bound."""
COLD = 60.0
"""Longest time from entering the bus to the first sample of a cold start [s]; travels and switching
on take less (`hil run` uses it, too)."""


class Symmetry(FileModel):
    """Symmetry test of an axis, as stored in `friction.yaml`.

    Attributes
    ----------
    asymmetry, standard_error : float
        Excess of forward friction over the mean, as a share of the friction level.
    p_zero : float
        Probability of a mean at least as far from zero if friction is symmetric.
    p_bound : float
        Probability of a mean at least as far beyond `bound` if the asymmetry does not exceed it.
    bound : float
        Share of the friction level.
    passed : bool
        True if an identification may rely on symmetric friction of this axis.
    """

    measurements: int
    asymmetry: float
    standard_error: float
    p_zero: float
    p_bound: float
    bound: float
    passed: bool

    @property
    def verdict(self) -> str:
        """Result of the symmetry test in words."""
        if not self.passed:
            return f"asymmetric by more than {100 * self.bound:g} %"
        if self.p_zero < SIGNIFICANT:
            return f"asymmetric, within {100 * self.bound:g} %"
        return "no asymmetry found"


def judge_points(points: Sequence[FrictionPoint], bound: float = BOUND) -> dict[int, Symmetry]:
    """Test the symmetry of all axes with a known gravity torque; keys are axes from 0.

    Parameters
    ----------
    bound : float
        Largest acceptable asymmetry, as a share of the friction level.
    """
    found = {}
    for axis in sorted({point.axis for point in points}):
        own = [p for p in points if p.axis == axis and p.absolute and p.friction > 0]
        if len(own) >= FOR_A_LAW:
            level = np.array([p.friction for p in own])
            shares = np.array([p.common for p in own]) / level
            errors = np.array([p.common_error for p in own]) / level
            gravity = float(np.mean([p.gravity_error / p.friction for p in own]))
            found[axis] = _test(shares, errors, gravity, bound)
    return found


def judge_local_values(values: Iterable[LocalValue], bound: float = BOUND) -> dict[int, Symmetry]:
    """Test the symmetry of axes from gravity measurements; result as in `judge_points`.

    The parameters that predict gravity come from the same measurements. Unless the asymmetry of
    friction was fitted too, as in the improved method, the parameters absorb the mean deviation of
    an axis.
    """
    shares: dict[int, list[float]] = {}
    for v in values:
        if v.symbol == "g" and v.friction > 0:
            shares.setdefault(v.axis, []).append((v.value - v.model) / v.friction)
    return {
        axis: _test(np.array(own), np.ones(len(own)), 0.0, bound)
        for axis, own in sorted(shares.items())
        if len(own) >= FOR_A_LAW
    }


def _test(shares: Array, errors: Array, common: float, bound: float) -> Symmetry:
    """Test the weighted mean against zero and against the bound."""
    # a few points with small errors must not decide the mean
    weights = 1.0 / np.maximum(errors, float(np.median(errors))) ** 2
    weights = weights / weights.sum()
    mean, degrees = float(weights @ shares), len(shares) - 1
    scores = (weights * (shares - mean))[:, np.newaxis]
    error = math.hypot(scatter(scores, few=True)[0, 0] ** 0.5, common)
    scale = max(error, float(np.finfo(float).tiny))
    p_bound = float(special.stdtr(degrees, (bound - abs(mean)) / scale))
    return Symmetry(
        measurements=len(shares),
        asymmetry=mean,
        standard_error=error,
        p_zero=float(2 * special.stdtr(degrees, -abs(mean) / scale)),
        p_bound=p_bound,
        bound=bound,
        passed=p_bound >= SIGNIFICANT,
    )


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


FEWEST = 10
"""Minimum number of samples of a stroke at constant velocity."""


@dataclass(frozen=True, slots=True)
class FrictionPoint:
    """Friction of an axis at a speed.

    Attributes
    ----------
    axis : int
        Axis from 0.
    time : float
        Middle of the recording since the bus was entered [s].
    velocity : float
        Mean speed, positive [rad/s].
    friction : float
        Mean of both directions [N m].
    friction_error : float
        Standard error of `friction` within the measurement [N m].
    common : float
        Half-sum of both directions less the gravity torque: the asymmetry [N m]. Without a model it
        includes gravity.
    common_error : float
        Standard error of `common` within the measurement [N m].
    gravity_error : float
        Standard error of the compensated gravity torque [N m].
    absolute : bool
        True if gravity was compensated by a model or cannot act on the axis.
    """

    id: str
    axis: int
    time: float
    velocity: float
    friction: float
    friction_error: float
    common: float
    common_error: float
    gravity_error: float
    absolute: bool

    @property
    def forward(self) -> float:
        """Friction torque in positive direction [N m]."""
        return self.friction + (self.common if self.absolute else 0.0)

    @property
    def backward(self) -> float:
        """Friction torque in negative direction, negative [N m]."""
        return -self.friction + (self.common if self.absolute else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class GravityModel:
    """Base parameters of an identified model and their covariance, in the order of the model."""

    p: Array
    covariance: Array


def points(
    robot: Robot, recorded: Iterable[tuple[Friction, Recording]], model: GravityModel | None = None
) -> tuple[list[FrictionPoint], list[str]]:
    """Compute friction points from friction measurements.

    Parameters
    ----------
    recorded : iterable of (Friction, Recording)
    model : GravityModel, optional
        Compensates gravity.

    Returns
    -------
    list of FrictionPoint, list of str
        Points in the order of `recorded`, and the reasons for unused measurements.
    """
    found, left_out = [], []
    for measurement, recording in recorded:
        try:
            found.append(point(robot, measurement, signals(recording), model))
        except NotEnoughData as error:
            left_out.append(f"{measurement.id}: {error}")
    return found, left_out


def point(
    robot: Robot, m: Friction, s: Signals, model: GravityModel | None = None
) -> FrictionPoint:
    """Compute the friction point of a measurement.

    Raises
    ------
    NotEnoughData
        No window of constant velocity in both directions.
    """
    i = m.index
    # select samples at constant velocity by stroke, over common angles: whole motor turns
    gear_ratio = float(robot.gear_ratio[i])
    steady = [_steady(m, s, stroke) for stroke in range(m.n_strokes)]
    if any(window.sum() < FEWEST for window in steady):
        raise NotEnoughData(
            "no window of constant velocity in both directions; repeat the measurement"
        )
    q = s.q[:, m.index]
    low = max(float(q[window].min()) for window in steady)
    high = min(float(q[window].max()) for window in steady)
    turn = math.tau / gear_ratio
    if high - low > turn:
        high = low + math.floor((high - low) / turn) * turn
    windows = [window & (q >= low) & (q <= high) for window in steady]
    if any(window.sum() < FEWEST for window in windows):
        raise NotEnoughData(
            "both directions share too few angles at constant velocity; repeat the measurement"
        )
    gravity = gravity_torque(robot, model.p, s.q)[:, i] if model else np.zeros(len(s.time))
    torque = s.tau[:, i] - gravity
    middle = float(np.mean([s.q[w, i].mean() for w in windows]))
    means = np.array([_mean_at(s.q[w, i] - middle, torque[w]) for w in windows])
    # differences of successive samples are free of slow changes
    white = [np.sqrt(np.mean(np.diff(torque[w]) ** 2) / 2) for w in windows]
    noise = np.array(
        [float(each) / np.sqrt(w.sum()) for each, w in zip(white, windows, strict=True)]
    )
    when = np.array([s.time[w].mean() for w in windows])
    value, covariance = _level(means, noise, when)
    used = np.any(windows, axis=0)
    still = np.zeros_like(s.q[used])
    row = regressor(robot, s.q[used], still, still, joints=[i])[:, 0].mean(axis=0)
    uncertain = float(row @ model.covariance @ row) if model else 0.0
    return FrictionPoint(
        id=m.id,
        axis=i,
        time=float(s.time.mean()),
        velocity=float(np.mean([abs(s.qd[w, i].mean()) for w in windows])),
        friction=float(value[1]),
        friction_error=float(np.sqrt(covariance[1, 1])),
        common=float(value[0]),
        common_error=float(np.sqrt(covariance[0, 0])),
        gravity_error=math.sqrt(max(uncertain, 0.0)),
        absolute=model is not None or not base_parameters(robot).dependencies.gravity[i].any(),
    )


def _steady(m: Friction, s: Signals, stroke: int) -> Mask:
    """Select samples beyond the ramps of an axis, by position, without the initial transient."""
    profile = m.profile(stroke)
    away = profile.ramp + SETTLING * profile.peak
    low, high = sorted((profile.start, profile.end))
    begin, end = (low + away, high - profile.ramp)
    if stroke % 2:
        begin, end = (low + profile.ramp, high - away)
    q = s.q[:, m.index]
    steady: Mask = (s.stroke == stroke) & s.valid & (q > begin) & (q < end)
    return steady


def _mean_at(away: Array, torque: Array) -> float:
    """Return the mean torque at `away` = 0; windows of whole samples differ in mean angle."""
    mean = float(away.mean())
    slope = float((away - mean) @ torque / ((away - mean) @ (away - mean)))
    return float(torque.mean()) - slope * mean


def _level(means: Array, noise: Array, when: Array) -> tuple[Array, Array]:
    """Fit common part, friction and (from four strokes) drift; return values and covariance.

    Scatter between strokes beyond their noise enlarges the covariance.
    """
    s = np.resize([1.0, -1.0], len(means))
    # a rounded current may show no noise
    noise = np.maximum(noise, np.sqrt(np.finfo(float).eps) * np.abs(means).max())
    columns = [np.ones_like(s), s]
    if len(means) > 3:
        columns.append(s * (when - when.mean()))
    X = np.column_stack(columns) / noise[:, np.newaxis]
    y = means / noise
    Q, root = orthonormal(X)
    value, covariance = root @ (Q.T @ y), root @ root.T
    spare = len(means) - X.shape[1]
    if spare:
        covariance *= max(1.0, float(np.sum((y - X @ value) ** 2)) / spare)
    return value, covariance
