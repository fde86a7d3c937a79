"""Step 1, improved: a measurement condensed to what it says about all base parameters at once.

The paper's local models (19) and (21) regard one element of M(q) at a time, at one configuration,
and the axes that are not moved as still. Here every usable sample enters with the full row of the
regressor for the measured motion of all joints,

    Q_i - Qm_i = A_i(q, qd, qdd) p + F(t) a + G_i(q) b + e,

and friction is again fitted for this measurement alone; the columns, and which samples are usable,
are those of `hil.regression.terms`. The coefficients `a` are eliminated at once by orthogonal
projection (Frisch-Waugh-Lovell), so nothing about friction passes from one measurement to the next.

What is left of thousands of samples is a small information matrix and vector over p and b, which
step 2 adds up: least squares over all samples of the campaign, without ever stacking them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.model.motors import motor_torque
from hil.regression.least_squares import eliminated
from hil.regression.terms import FEWEST, term_columns, usable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.strokes import Strokes

    Array = NDArray[np.float64]


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
    items = [_condense_axis(robot, s, axis) for axis in measurement.moved]
    return [item for item in items if item is not None]


def _condense_axis(robot: Robot, s: Signals, axis: int) -> Condensed | None:
    used = s.valid & usable(robot, s, axis)
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
    rows, common, friction = term_columns(robot, s, axis)
    stacked = s.smoothed(np.column_stack([torques, motor, rows, common, friction]))[used]
    product, rank = eliminated(stacked.T @ stacked, friction.shape[1])
    return product, len(stacked) - rank
