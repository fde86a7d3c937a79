"""Step 1 as the paper has it: each measurement by itself gives one element of g(q) or M(q).

gravity, eq. (14)
    Friction is symmetric, so half the sum of the mean torques forward and backward at constant
    velocity is the gravity torque; half the difference is friction.
inertia, eq. (19), (20)
    The gravity torque is compensated by the model found from the gravity measurements; what is left
    is fitted by ``M_ii qdd + a1 qd + a2 sign(qd) + a3 cbrt(qd)``.
coupling, eq. (21)
    The torque is read on axis j, which creeps, while axis i accelerates: ``M_ji qdd_i`` and, for
    each stroke of the creeping axis, a level that holds its friction (the paper's ``a1 qd_j`` at
    constant ``qd_j``), gravity being compensated.

Samples slower than 5 % of the axis's speed limit are left out: presliding is no function of
velocity. The row that belongs to a value is the mean of the regressor's rows over the same samples,
not the row at the nominal configuration, since a window covers a range of q.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.dynamics import regressor
from hil.measurement import Coupling, Gravity, Inertia
from hil.motors import motor_torque

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.measurement import Measurement
    from hil.robot import Robot
    from hil.signals import Signals

    Array = NDArray[np.float64]

SLOW = 0.05
"""Share of the speed limit below which samples are left out."""
SETTLING = 0.16
"""Time after a ramp before the axis counts as at constant velocity [s]."""
STEADY = 0.1
"""Relative deviation from the profile velocity that still counts as constant."""
SHORTEST_WINDOW = 0.1
"""Of constant velocity [s]."""
FEWEST = 5
"""Samples for each coefficient of a fit."""
REFERENCE_SPEED = 0.1
"""Share of the speed limit at which friction levels are stated."""


class NotEnoughData(Exception):
    """A recording without enough usable samples."""


@dataclass(frozen=True, slots=True, eq=False)
class LocalFit:
    """What one measurement says by itself.

    Attributes
    ----------
    id, kind : str
    axis, partner : int
        Joint whose torque was read, joint that was accelerated; indices from 0.
    q : ndarray, shape (n_joints,)
        Mean configuration [rad].
    time : float
        Middle of the recording since the bus was entered [s].
    torque, motor : float
        What the measured torque and the motors' part H of it amount to as a torque [N m] or as a
        moment of inertia [kg m^2].
    gravity : ndarray, shape (n_base,)
        Share of the base parameters in `torque` by gravity; zero for gravity measurements, whose
        value it is.
    row : ndarray, shape (n_base,)
        The value that belongs to the model: ``row @ p``.
    value : float
        g_i [N m], M_ii or M_ji [kg m^2]: ``torque - motor - gravity @ p_g``.
    standard_error : float
        From the scatter inside the measurement.
    friction : float
        Level at `REFERENCE_SPEED`, mean of both directions [N m].
    residual : float
        Root mean square of what the fit leaves [N m].
    """

    id: str
    kind: str
    axis: int
    partner: int
    q: Array
    time: float
    torque: float
    motor: float
    gravity: Array
    row: Array
    value: float
    standard_error: float
    friction: float
    residual: float


def fit(robot: Robot, measurement: Measurement, s: Signals, p_g: Array) -> LocalFit:
    """Evaluate one measurement.

    Parameters
    ----------
    robot : Robot
    measurement : Gravity, Inertia or Coupling
    s : Signals
    p_g : ndarray, shape (n_base,)
        Base parameters of which the gravitational ones are right. Gravity measurements do not use
        them.

    Raises
    ------
    NotEnoughData
        Too few usable samples.
    """
    if isinstance(measurement, Gravity):
        return _gravity(robot, measurement, s)
    if isinstance(measurement, Inertia):
        return _inertia(robot, measurement, s, p_g)
    return _coupling(robot, measurement, s, p_g)


def _gravity(robot: Robot, m: Gravity, s: Signals) -> LocalFit:
    i = m.index
    motor = motor_torque(robot, s.q, s.qd, s.qdd)[:, i]
    signals = s.filtered(np.column_stack([s.tau[:, i], motor, _gravity_rows(robot, s, i)]))
    means: tuple[list[Array], list[Array]] = ([], [])
    for stroke in range(m.n_strokes):
        window = _window(m, s, stroke)
        if window.sum() * s.period >= SHORTEST_WINDOW:
            means[stroke % 2].append(signals[window].mean(axis=0))
    pairs = min(len(means[0]), len(means[1]))
    if not pairs:
        raise NotEnoughData(f"{m.id}: no window of constant velocity in both directions; repeat it")
    forward, backward = np.array(means[0][:pairs]), np.array(means[1][:pairs])
    half_sums, half_differences = (forward + backward) / 2, (forward - backward) / 2
    torque, moved = half_sums[:, 0].mean(), half_sums[:, 1].mean()
    scatter = float(np.std(half_sums[:, 0], ddof=1)) if pairs > 1 else float("nan")
    return LocalFit(
        id=m.id,
        kind="gravity",
        axis=i,
        partner=i,
        q=_mean_q(s, s.stroke >= 0),
        time=float(s.time.mean()),
        torque=float(torque),
        motor=float(moved),
        gravity=np.zeros(signals.shape[1] - 2),
        row=half_sums[:, 2:].mean(axis=0),
        value=float(torque - moved),
        standard_error=scatter / np.sqrt(pairs),
        friction=float(half_differences[:, 0].mean()),
        residual=scatter,
    )


def _inertia(robot: Robot, m: Inertia, s: Signals, p_g: Array) -> LocalFit:
    i = m.index
    v = s.qd[:, i]
    used = usable(robot, s, i)
    columns = np.column_stack([s.qdd[:, i], v, np.sign(v), np.cbrt(v)])
    solution = _solve(m, robot, s, i, columns, used, p_g)
    reference = REFERENCE_SPEED * robot.velocity_limit[i]
    levels = np.array([reference, 1.0, np.cbrt(reference)])
    return _mass_fit(robot, m, s, (i, i), used, solution, float(solution.friction[1:] @ levels))


def _coupling(robot: Robot, m: Coupling, s: Signals, p_g: Array) -> LocalFit:
    j, i = m.index, m.partner.index
    used = usable(robot, s, j) & (s.partner_stroke >= 0) & (s.stroke >= 0)
    levels = (s.stroke[:, np.newaxis] == np.arange(m.n_strokes)).astype(float)
    columns = np.column_stack([s.qdd[:, i], levels])
    solution = _solve(m, robot, s, j, columns, used, p_g)
    forward, backward = solution.friction[1::2].mean(), solution.friction[2::2].mean()
    return _mass_fit(robot, m, s, (j, i), used, solution, float(forward - backward) / 2)


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """Eq. (20) for the torque, the motors' part of it and each base parameter's gravity."""

    torque: float
    motor: float
    gravity: Array
    friction: Array
    standard_error: float
    residual: float


def _solve(
    m: Measurement,
    robot: Robot,
    s: Signals,
    axis: int,
    columns: Array,
    used: NDArray[np.bool_],
    p_g: Array,
) -> _Solution:
    """Fit `columns`, of which the first is the acceleration, to the torque of `axis`."""
    W = s.filtered(columns)[used]
    if len(W) < FEWEST * W.shape[1]:
        raise NotEnoughData(
            f"{m.id}: {len(W)} usable samples must be at least {FEWEST * W.shape[1]}; repeat it"
            " with a longer stroke or a higher velocity"
        )
    motor = motor_torque(robot, s.q, s.qd, s.qdd)[:, axis]
    sides = np.column_stack([s.tau[:, axis], motor, _gravity_rows(robot, s, axis)])
    C = s.filtered(sides)[used]
    scale = np.linalg.norm(W, axis=0)
    scale[scale == 0] = 1.0
    pr = np.linalg.lstsq(W / scale, C, rcond=None)[0] / scale[:, np.newaxis]
    weights = np.concatenate([[1.0, -1.0], -p_g])
    left = (C - W @ pr) @ weights
    variance = left @ left / (len(C) - W.shape[1])
    inverse = np.linalg.pinv((W / scale).T @ (W / scale))
    return _Solution(
        torque=float(pr[0, 0]),
        motor=float(pr[0, 1]),
        gravity=pr[0, 2:],
        friction=pr @ weights,
        standard_error=float(np.sqrt(variance * inverse[0, 0]) / scale[0]),
        residual=float(np.sqrt(variance)),
    )


def _mass_fit(
    robot: Robot,
    m: Inertia | Coupling,
    s: Signals,
    element: tuple[int, int],
    used: NDArray[np.bool_],
    solution: _Solution,
    friction: float,
) -> LocalFit:
    """Put together what a measurement says about an `element` of M(q)."""
    weight = s.qdd[used, element[1]] ** 2
    rows = _inertia_rows(robot, s, *element)[used]
    return LocalFit(
        id=m.id,
        kind=m.kind,
        axis=element[0],
        partner=element[1],
        q=_mean_q(s, used),
        time=float(s.time.mean()),
        torque=solution.torque,
        motor=solution.motor,
        gravity=solution.gravity,
        row=weight @ rows / weight.sum(),
        value=float(solution.friction[0]),
        standard_error=solution.standard_error,
        friction=friction,
        residual=solution.residual,
    )


def usable(robot: Robot, s: Signals, axis: int) -> NDArray[np.bool_]:
    """Samples of an axis in motion, apart from its reversals as far as the filter reaches."""
    v = s.filtered(s.qd[:, axis])
    slow = np.abs(v) < SLOW * robot.velocity_limit[axis]
    used: NDArray[np.bool_] = s.away_from(slow) & s.valid
    return used


def _window(m: Gravity, s: Signals, stroke: int) -> NDArray[np.bool_]:
    """Samples at constant velocity, the transient after the ramp left out."""
    v = s.filtered(s.qd[:, m.index])
    wanted = m.velocity if stroke % 2 == 0 else -m.velocity
    off = (s.stroke != stroke) | (np.abs(v - wanted) > STEADY * m.velocity)
    steady = ~off & s.valid
    if steady.any():
        first = int(np.flatnonzero(steady)[0])
        steady[first : first + round(SETTLING / s.period)] = False
    return steady


def _gravity_rows(robot: Robot, s: Signals, axis: int) -> Array:
    still = np.zeros_like(s.q)
    return regressor(robot, s.q, still, still, joints=[axis])[:, 0]


def _inertia_rows(robot: Robot, s: Signals, axis: int, accelerated: int) -> Array:
    still, unit = np.zeros_like(s.q), np.zeros_like(s.q)
    unit[:, accelerated] = 1.0
    moving = regressor(robot, s.q, still, unit, joints=[axis])[:, 0]
    return moving - _gravity_rows(robot, s, axis)


def _mean_q(s: Signals, used: NDArray[np.bool_]) -> Array:
    mean: Array = s.q[used].mean(axis=0)
    return mean
