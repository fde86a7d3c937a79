"""The improved method's equation, measured or foreseen: its columns, samples and unknowns.

Every usable sample of an axis i says

    Q_i - Qm_i = A_i(q, qd, qdd) p + F(t) a + G_i(q) b + e

with base parameters p, their rows taken on the links' side of the gears; friction of this
measurement alone, F; and what is common to all measurements of the axis, G.

F holds five functions of speed and the drift of the level, sign(v) s. Friction falls as
motion stirs the lubricant and as its own power heats the gear, both in step with the way s that
the axis has gone, not with time: between strokes time passes and friction stays. An inertia takes
up what is left of such a drift, since over every stroke, forth or back, the integral of
t sign(v) qdd is minus the way.

G holds a constant and |v| (asymmetric friction, sensor offset), torque ripple at multiples of the
motor's angle (zero at those that look like something else, `hil.least_squares.ripple`), and
friction that grows with the transmitted torque, |Q_t| sign(v) and, where that differs by direction,
|Q_t|. What is transmitted is not known before there is a first estimate, so these two are zero
here, and the estimator fills them in.

Left out are samples near a reversal, where friction is no function of velocity, and those where the
acceleration changes fast, at the corners of the trapezoid: there, differences of positions and
samples of the torque do not show the same instant.

None of this needs a torque. So it is the same for a motion that was measured
(`hil.estimation.signals`) and for one that is planned
(`hil.planning.prediction.predicted_samples`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from hil.least_squares.layout import axis_place
from hil.least_squares.ripple import RIPPLE_ORDERS, ripple_orders
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.model.robot import Robot

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

ASYMMETRIC = (0, 1)
"""Places of the columns of G by which friction differs by direction."""
LOAD = 2 + 2 * len(RIPPLE_ORDERS)
"""Place of the column of G that grows with the transmitted torque; its coefficient is mu."""
N_COMMON = LOAD + 2
"""Columns of G of one axis."""
BEND = 0.08
"""Share of the speed at which the arc tangent of friction bends."""
SLOW = 0.05
"""Share of the speed limit below which samples are left out."""
JERK = 5.0
"""Samples are used up to this jerk, per acceleration limit of the axis [1/s]."""
FEWEST = 50
"""Usable samples below which an axis's share of a measurement is left out."""


class Motion(Protocol):
    """Samples of one measurement on an even grid of time."""

    @property
    def period(self) -> float:
        """Between samples [s]."""

    @property
    def time(self) -> Array:
        """Shape (n,) [s]."""

    @property
    def q(self) -> Array:
        """Shape (n, n_joints) [rad]."""

    @property
    def qd(self) -> Array:
        """Shape (n, n_joints) [rad/s]."""

    @property
    def qdd(self) -> Array:
        """Shape (n, n_joints) [rad/s^2]."""

    @property
    def link(self) -> tuple[Array, Array, Array]:
        """q, qd and qdd on the links' side of the gears, which is `q` as long as they are rigid."""

    def smoothed(self, x: Array) -> Array:
        """Low-pass along the first axis (`hil.least_squares.window`)."""

    def away_from(self, excluded: Mask) -> Mask:
        """Samples that nothing connects to the `excluded` ones, shape (n,)."""


def term_columns(robot: Robot, motion: Motion, axis: int) -> tuple[Array, Array, Array]:
    """Columns of an axis's base parameters, common terms and friction, each of shape (n, ...)."""
    rows = regressor(robot, *motion.link, joints=[axis])[:, 0]
    v = motion.qd[:, axis] / speed_scale(robot, motion, axis)
    angle = robot.gear_ratio[axis] * motion.q[:, axis]
    return rows, _common(angle, v, ripple_orders(robot, axis)), friction_columns(motion, v)


def friction_columns(motion: Motion, v: Array) -> Array:
    """F: what friction of one measurement can be, shape (n, 6).

    Parameters
    ----------
    v : ndarray, shape (n,)
        Velocity of the axis as share of its limit.
    """
    free_of_noise = motion.smoothed(v)
    direction, way = np.sign(free_of_noise), np.cumsum(np.abs(free_of_noise))
    gone = (way - way.mean()) / max(float(np.ptp(way)), motion.period)
    return np.column_stack([direction, v, *curved(v), direction * gone])


def curved(v: Array) -> tuple[Array, Array, Array]:
    """Two degressive functions of a share of the speed, and a progressive one."""
    return np.cbrt(v), np.arctan(v / BEND), v * np.abs(v)


def speed_scale(robot: Robot, motion: Motion, axis: int) -> float:
    """Speed limit of an axis; where that is unknown, its greatest speed in the motion."""
    return limit_or_reached(robot.velocity_limit[axis], motion.smoothed(motion.qd[:, axis]))


def limit_or_reached(limit: float, x: Array) -> float:
    """Limit of a quantity; where that is unknown (NaN), the greatest size that it has, above 0."""
    reached = max(float(np.abs(x).max(initial=0.0)), float(np.finfo(float).tiny))
    return reached if np.isnan(limit) else float(limit)


def moving(robot: Robot, motion: Motion, axis: int) -> Mask:
    """Samples of an axis away from reversals, shape (n,)."""
    v = np.abs(motion.smoothed(motion.qd[:, axis]))
    slow = v < SLOW * speed_scale(robot, motion, axis)
    return motion.away_from(slow)


def usable(robot: Robot, motion: Motion, axis: int) -> Mask:
    """Samples of an axis in steady motion, away from reversals and corners, shape (n,)."""
    acceleration = motion.smoothed(motion.qdd[:, axis])
    jerk = np.abs(np.gradient(acceleration, motion.period))
    steady: Mask = jerk < JERK * limit_or_reached(robot.acceleration_limit[axis], acceleration)
    return moving(robot, motion, axis) & steady


def common_terms() -> tuple[str, ...]:
    """Names of the columns of G."""
    waves = (f"{wave} {order}" for wave in ("cosine", "sine") for order in RIPPLE_ORDERS)
    return ("offset", "asymmetric", *waves, "load", "load by direction")


def place(robot: Robot, axis: int) -> NDArray[np.intp]:
    """Where base parameters and an axis's common terms stand among all unknowns."""
    return axis_place(len(base_parameters(robot)), N_COMMON, axis)


def n_unknowns(robot: Robot) -> int:
    """Base parameters and, axis by axis, the common terms."""
    return len(base_parameters(robot)) + robot.n_joints * N_COMMON


def multiples(angle: Array, orders: range) -> NDArray[np.complex128]:
    """exp(j n angle) of successive orders n, shape (n_orders, n): cosines and sines."""
    once = np.exp(1j * angle)
    factors = np.tile(once, (len(orders), 1))
    factors[0] = once ** orders[0]
    return np.cumprod(factors, axis=0)


def _common(angle: Array, v: Array, orders: Sequence[int]) -> Array:
    columns = np.zeros((N_COMMON, len(v)))
    columns[0], columns[1] = 1.0, np.abs(v)
    if orders:
        ripple = multiples(angle, RIPPLE_ORDERS)
        ripple[np.setdiff1d(RIPPLE_ORDERS, orders) - RIPPLE_ORDERS[0]] = 0.0
        columns[2:LOAD] = *ripple.real, *ripple.imag
    return columns.T
