"""What a measurement will say about all base parameters, friction eliminated.

The joint estimator takes of every usable sample of an axis

    Q_i - Qm_i = A_i(q, qd, qdd) p + F(t) a + G_i(q) b + e

(`hil.estimation.condensed`), with the friction of this measurement alone, F: sign(v), v, cbrt(v),
sign(v) t, and what is common to all measurements of the axis, G: a constant, |v| and ripple. None
of the columns needs a torque, so the information X'X over p and b, orthogonal to F, is known as
soon as the motion is planned.

What torque noise leaves of it is a matter of two more matrices. The estimator is least squares, so
the covariance of X'e is X' E(e e') X, with e

- white in the torque as it is read, but smoothed like everything (`white`), and
- friction that wanders: sign(v) times a random walk of the level, of which sign(v) and sign(v) t
  take the larger part away (`wander`, for a walk of unit intensity).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.planning.forecast import forecast
from hil.planning.measurement import Coupling

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.forecast import Forecast
    from hil.planning.measurement import Strokes

    Array = NDArray[np.float64]

RIPPLE_ORDERS = (1, 2, 3, 4, 5, 6)
"""Multiples of the motor's angle."""
N_COMMON = 2 + 2 * len(RIPPLE_ORDERS)
"""Columns of G of one axis."""
FEWEST = 50
"""Usable samples below which an axis's share of a measurement counts for nothing."""
_RANK = 1e-8


@dataclass(frozen=True, slots=True, eq=False)
class Share:
    """What one axis's torque in one measurement will tell.

    Attributes
    ----------
    axis : int
        Index from 0.
    n : int
        Usable samples less eliminated coefficients.
    information, white, wander : ndarray, shape (n_base + N_COMMON, n_base + N_COMMON)
        X'X, and the covariance of X'e for white noise of 1 N m and for friction whose level walks
        by 1 N m in 1 s [1/(N m)^2 times that of the parameters].
    """

    axis: int
    n: int
    information: Array
    white: Array
    wander: Array


def shares(robot: Robot, measurement: Strokes, period: float) -> list[Share]:
    """What `measurement` will tell, sampled every `period` [s]: one item for each axis it moves."""
    planned = forecast(measurement, period)
    found = (_share(robot, planned, axis) for axis in moved_axes(measurement))
    return [share for share in found if share is not None]


def moved_axes(measurement: Strokes) -> tuple[int, ...]:
    """Axes that a measurement moves on purpose, indices from 0."""
    if isinstance(measurement, Coupling):
        return measurement.index, measurement.partner.index
    return (measurement.index,)


def place(robot: Robot, axis: int) -> NDArray[np.intp]:
    """Where base parameters and an axis's common terms stand among all unknowns."""
    n_base = len(base_parameters(robot))
    first = n_base + axis * N_COMMON
    return np.concatenate([np.arange(n_base), np.arange(first, first + N_COMMON)])


def n_unknowns(robot: Robot) -> int:
    """Base parameters and, axis by axis, the common terms."""
    return len(base_parameters(robot)) + robot.n_joints * N_COMMON


def _share(robot: Robot, planned: Forecast, axis: int) -> Share | None:
    used = planned.usable(robot, axis)
    if used.sum() < FEWEST:
        return None
    rows = regressor(robot, planned.q, planned.qd, planned.qdd, joints=[axis])[:, 0]
    common, friction = _common(robot, planned, axis), _friction(robot, planned, axis)
    stacked = planned.smoothed(np.column_stack([rows, common, friction]))[used]
    kept = stacked.shape[1] - friction.shape[1]
    basis = _orthonormal(stacked[:, kept:])
    left = stacked[:, :kept] - basis @ (basis.T @ stacked[:, :kept])
    X = np.zeros((len(used), kept))
    X[used] = left
    smoothed = planned.smoothed(X)
    later = np.cumsum((X * friction[:, :1])[::-1], axis=0)
    return Share(
        axis=axis,
        n=len(left) - basis.shape[1],
        information=left.T @ left,
        white=smoothed.T @ smoothed,
        wander=planned.period * later.T @ later,
    )


def _friction(robot: Robot, planned: Forecast, axis: int) -> Array:
    v = planned.qd[:, axis] / robot.velocity_limit[axis]
    direction = np.sign(planned.smoothed(v))
    elapsed = (planned.time - planned.time.mean()) / np.ptp(planned.time)
    return np.column_stack([direction, v, np.cbrt(v), direction * elapsed])


def _common(robot: Robot, planned: Forecast, axis: int) -> Array:
    speed = np.abs(planned.qd[:, axis]) / robot.velocity_limit[axis]
    angle = robot.gear_ratio[axis] * planned.q[:, axis, np.newaxis] * np.array(RIPPLE_ORDERS)
    return np.column_stack([np.ones(len(speed)), speed, np.cos(angle), np.sin(angle)])


def _orthonormal(columns: Array) -> Array:
    """Orthonormal basis of the columns' span."""
    length = np.linalg.norm(columns, axis=0)
    u, sizes, _ = np.linalg.svd(columns / np.where(length > 0, length, 1.0), full_matrices=False)
    basis: Array = u[:, sizes > _RANK * sizes[0]]
    return basis
