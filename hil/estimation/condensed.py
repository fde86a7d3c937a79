"""Step 1, improved: a measurement condensed to what it says about all base parameters at once.

The paper's local models (19) and (21) regard one element of M(q) at a time, at one configuration,
and the axes that are not moved as still. Here every usable sample enters with the full row of the
regressor for the measured motion of all joints,

    Q_i - Qm_i = A_i(q, qd, qdd) p + F(t) a + G_i(q) b + e,

and friction is again fitted for this measurement alone: F holds sign(v), v, cbrt(v) and the drift
of the level, sign(v) t. Its coefficients `a` are eliminated at once by orthogonal projection
(Frisch-Waugh-Lovell), so nothing about friction passes from one measurement to the next. What is
the same all the time is common to all measurements of an axis: G holds a constant and |v|
(asymmetric friction, sensor offset) and torque ripple at multiples of the motor's angle.

Left out are samples near a reversal, where friction is no function of velocity, and those where the
acceleration changes fast, at the corners of the trapezoid: there, differences of positions and
samples of the torque do not show the same instant.

What is left of thousands of samples is a small information matrix and vector over p and b, which
step 2 adds up: least squares over all samples of the campaign, without ever stacking them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.local_fits import SLOW
from hil.model.dynamics import regressor
from hil.model.motors import motor_torque
from hil.planning.measurement import Coupling

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import Strokes

    Array = NDArray[np.float64]

RIPPLE_ORDERS = (1, 2, 3, 4, 5, 6)
"""Multiples of the motor's angle: unbalance, misalignment, poles and slots of common motors."""
N_COMMON = 2 + 2 * len(RIPPLE_ORDERS)
"""Columns of G of one axis."""
JERK = 5.0
"""Samples are used up to this jerk, per acceleration limit of the axis [1/s]."""
FEWEST = 50
"""Usable samples below which an axis's share of a measurement is left out."""
_RANK = 1e-12
"""Relative size below which a combination of friction's columns counts as none."""


@dataclass(frozen=True, slots=True, eq=False)
class Condensed:
    """What the torque of one axis in one measurement says, friction eliminated.

    Attributes
    ----------
    axis : int
        Index from 0.
    product : ndarray, shape (2 + n_base + N_COMMON, 2 + n_base + N_COMMON)
        Inner products of all columns: y, the torque without the motor's part; that part; X, base
        parameters and the axis's common terms.
    n : int
        Samples less eliminated coefficients.
    """

    axis: int
    product: Array
    n: int

    @property
    def information(self) -> Array:
        """X'X, shape (n_base + N_COMMON, n_base + N_COMMON)."""
        return self.product[2:, 2:]

    @property
    def vector(self) -> Array:
        """X'y, shape (n_base + N_COMMON,)."""
        return self.product[2:, 0]

    @property
    def motor(self) -> Array:
        """X' times the motor's part of the torque, shape (n_base + N_COMMON,)."""
        return self.product[2:, 1]

    @property
    def square(self) -> float:
        """Of y by itself."""
        return float(self.product[0, 0])


def condense(robot: Robot, measurement: Strokes, s: Signals) -> list[Condensed]:
    """Condense one measurement, one item for each axis that moved on purpose."""
    items = [_condense_axis(robot, s, axis) for axis in moved_axes(measurement)]
    return [item for item in items if item is not None]


def moved_axes(measurement: Strokes) -> tuple[int, ...]:
    """Axes that a measurement moves on purpose, indices from 0."""
    if isinstance(measurement, Coupling):
        return measurement.index, measurement.partner.index
    return (measurement.index,)


def _condense_axis(robot: Robot, s: Signals, axis: int) -> Condensed | None:
    used = usable(robot, s, axis)
    if used.sum() < FEWEST:
        return None
    motor = motor_torque(robot, s.q, s.qd, s.qdd)[:, axis]
    product, n = products(robot, s, axis, (s.tau[:, axis] - motor)[:, np.newaxis], used)
    return Condensed(axis=axis, product=product, n=n)


def products(
    robot: Robot, s: Signals, axis: int, torques: Array, used: NDArray[np.bool_]
) -> tuple[Array, int]:
    """Inner products of all columns of an axis, friction eliminated.

    Parameters
    ----------
    torques : ndarray, shape (n, k)
        Columns of their own.
    used : ndarray of bool, shape (n,)

    Returns
    -------
    product : ndarray, shape (k + 1 + n_base + N_COMMON, ...)
        Of `torques`, the motor's part, base parameters and common terms, all smoothed.
    n : int
        Samples less eliminated coefficients.
    """
    motor = motor_torque(robot, s.q, s.qd, s.qdd)[:, axis]
    rows, common, friction = columns(robot, s, axis)
    stacked = s.smoothed(np.column_stack([torques, motor, rows, common, friction]))[used]
    product, rank = eliminated(stacked.T @ stacked, friction.shape[1])
    return product, len(stacked) - rank


def columns(robot: Robot, s: Signals, axis: int) -> tuple[Array, Array, Array]:
    """Columns of an axis's base parameters, common terms and friction, each of shape (n, ...)."""
    limit = float(robot.velocity_limit[axis])
    rows = regressor(robot, s.q, s.qd, s.qdd, joints=[axis])[:, 0]
    return rows, _common(robot, s, axis, limit), _friction(s, axis, limit)


def eliminated(product: Array, k: int) -> tuple[Array, int]:
    """Inner products of columns with the span of the last `k` projected out, and its rank.

    Parameters
    ----------
    product : ndarray, shape (n + k, n + k)

    Returns
    -------
    product : ndarray, shape (n, n)
    rank : int
    """
    n = len(product) - k
    diagonal = np.diag(product)[n:]
    scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    sizes, vectors = np.linalg.eigh(product[n:, n:] * np.outer(scale, scale))
    told = sizes > _RANK * sizes[-1]
    basis = scale[:, np.newaxis] * vectors[:, told] / np.sqrt(sizes[told])
    within = product[:n, n:] @ basis
    return product[:n, :n] - within @ within.T, int(told.sum())


def usable(robot: Robot, s: Signals, axis: int) -> NDArray[np.bool_]:
    """Samples of an axis in steady motion, away from reversals and corners, shape (n,)."""
    slow = np.abs(s.smoothed(s.qd[:, axis])) < SLOW * robot.velocity_limit[axis]
    jerk = np.abs(np.gradient(s.smoothed(s.qdd[:, axis]), s.period))
    steady = jerk < JERK * robot.acceleration_limit[axis]
    used: NDArray[np.bool_] = s.valid & s.away_from(slow) & steady
    return used


def _friction(s: Signals, axis: int, limit: float) -> Array:
    v = s.qd[:, axis] / limit
    direction = np.sign(s.smoothed(v))
    elapsed = (s.time - s.time.mean()) / max(float(np.ptp(s.time)), s.period)
    return np.column_stack([direction, v, np.cbrt(v), direction * elapsed])


def _common(robot: Robot, s: Signals, axis: int, limit: float) -> Array:
    speed = np.abs(s.qd[:, axis]) / limit
    angle = robot.gear_ratio[axis] * s.q[:, axis, np.newaxis] * np.array(RIPPLE_ORDERS)
    return np.column_stack([np.ones(len(speed)), speed, np.cos(angle), np.sin(angle)])


