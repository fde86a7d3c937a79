"""Equation of the improved method for measured or planned motions: columns, samples, unknowns.

Every usable sample of an axis i gives the equation

    Q_i - Qm_i = A_i(q, qd, qdd) p + F(t) a + G_i(q) b + e

with base parameters p and their regressor A_i on the link side of the gears, friction F of this
measurement alone, and terms G common to all measurements of the axis.

F holds five functions of speed and the drift of the level, sign(v) s. Friction falls as motion
stirs the lubricant and as friction power heats the gear. Both follow the distance s, not the time:
during a rest between strokes friction hardly changes. Without this column an inertia would absorb
the drift, since the integral of t sign(v) qdd over every stroke is minus the distance.

G holds a constant and |v| (asymmetric friction, sensor offset), torque ripple at multiples of the
motor angle (zero at multiples that cannot be distinguished from other columns,
`hil.friction.ripple`), and load friction: |Q_t| sign(v) with the transmitted torque Q_t and, for
load friction that differs by direction, |Q_t|. The transmitted torque is unknown before a first
estimate. These two columns are zero here and filled in by the estimator.

Samples near a reversal are left out, where friction is no function of velocity, and samples of high
jerk at the corners of the trapezoid, where differences of positions and samples of the torque
belong to different instants (`usable`).

No column needs a torque. The equation therefore serves measured motions (`hil.estimation.signals`)
and planned motions (`hil.planning.prediction.information`).
"""

from __future__ import annotations

from math import isnan
from typing import TYPE_CHECKING, Protocol

import numpy as np

from hil.friction.direction import sign_direction
from hil.friction.ripple import RIPPLE_ORDERS, ripple_orders
from hil.friction.terms import DIRECTED, DRIFT, LOAD_BY_DIRECTION, friction_columns
from hil.least_squares.layout import axis_place
from hil.least_squares.window import LONGEST, SECOND, widen
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from hil.arrays import Array, Indices, Mask
    from hil.model.robot import Robot


OWN = (*(term for term in DIRECTED if term != "load"), DRIFT)
"""Columns of F: friction terms of one measurement."""
COMMON = (
    "offset", "asymmetric",
    *(f"{wave} {order}" for wave in ("cosine", "sine") for order in RIPPLE_ORDERS),
    "load", LOAD_BY_DIRECTION,
)  # fmt: skip
"""Columns of G: terms common to all measurements of an axis."""
ASYMMETRIC = tuple(COMMON.index(term) for term in ("offset", "asymmetric"))
"""Indices of the columns of G for friction that differs by direction."""
LOAD = COMMON.index("load")
"""Index of the load friction |Q_t| sign(v) in G; its coefficient is mu."""
N_COMMON = len(COMMON)
"""Number of columns of G of one axis."""
SLOW = 0.05
"""Share of the speed limit below which samples are not used."""
JERK = 5.0
"""Largest jerk of used samples, as a multiple of the axis's acceleration limit [1/s]."""
EVERY = slice(None)
"""Every sample."""
FEWEST = 50
"""Least number of usable samples of an axis in a measurement."""


class Motion(Protocol):
    """Samples of a measurement on an even grid of time."""

    @property
    def period(self) -> float:
        """Sample period [s]."""

    @property
    def time(self) -> Array:
        """Instants, shape (n,) [s]."""

    @property
    def q(self) -> Array:
        """Positions, shape (n, n_joints) [rad]."""

    @property
    def qd(self) -> Array:
        """Velocities, shape (n, n_joints) [rad/s]."""

    @property
    def qdd(self) -> Array:
        """Accelerations, shape (n, n_joints) [rad/s^2]."""

    @property
    def link(self) -> tuple[Array, Array, Array]:
        """Return q, qd, qdd on the link side of the gears; equal to the motor side if rigid."""

    def smoothed(self, x: Array) -> Array:
        """Low-pass a signal along the first axis (`hil.least_squares.window`)."""

    def away_from(self, excluded: Mask) -> Mask:
        """Return a mask of samples without influence of the `excluded` samples, shape (n,)."""


def base_rows(robot: Robot, motion: Motion, axis: int, at: slice | Indices = EVERY) -> Array:
    """Return the regressor rows of an axis's base parameters, shape (n, n_base)."""
    q, qd, qdd = motion.link
    return regressor(robot, q[at], qd[at], qdd[at], [axis])[:, 0]


def term_columns(
    robot: Robot, motion: Motion, axis: int, rows: Array | None = None, at: slice | Indices = EVERY
) -> tuple[Array, Array, Array]:
    """Return columns of an axis's base parameters, common terms and friction, each (n, ...).

    `rows` are the regressor rows of `base_rows`, if already computed; `at` are the samples, by
    default all.
    """
    rows = base_rows(robot, motion, axis, at) if rows is None else rows
    v = motion.qd[:, axis] / speed_scale(robot, motion, axis)
    seen = (*COMMON[:2], *(f"{wave} {n}" for wave in ("cosine", "sine")
                           for n in ripple_orders(robot, axis)))  # fmt: skip
    angle, common = robot.gear_ratio[axis] * motion.q[at, axis], np.zeros((len(rows), N_COMMON))
    places, own = [COMMON.index(term) for term in seen], v[at]
    common[:, places] = friction_columns(own, sign_direction(own, 0.0), angle=angle, terms=seen)
    return rows, common, own_friction(motion, v, at)


def own_friction(motion: Motion, v: Array, at: slice | Indices = EVERY) -> Array:
    """Return F, the friction columns of a measurement at some samples, shape (n, 6).

    Parameters
    ----------
    v : ndarray, shape (n,)
        Velocity of the axis as a share of the speed limit.
    """
    free_of_noise = motion.smoothed(v)
    distance = np.cumsum(np.abs(free_of_noise))
    gone = (distance - distance.mean()) / max(float(np.ptp(distance)), motion.period)
    return friction_columns(v[at], sign_direction(free_of_noise[at], 0.0), gone=gone[at], terms=OWN)


def speed_scale(robot: Robot, motion: Motion, axis: int) -> float:
    """Return the speed limit of an axis; the largest speed in the motion if unknown."""
    limit = float(robot.velocity_limit[axis])
    return limit_or_reached(limit, motion.smoothed(motion.qd[:, axis])) if isnan(limit) else limit


def limit_or_reached(limit: float, x: Array) -> float:
    """Return the limit of a quantity, or the largest absolute value (above 0) if it is NaN."""
    reached = max(float(np.abs(x).max(initial=0.0)), float(np.finfo(float).tiny))
    return reached if np.isnan(limit) else float(limit)


def moving(robot: Robot, motion: Motion, axis: int) -> Mask:
    """Return a mask of an axis's samples away from reversals, shape (n,)."""
    least, qd = SLOW * speed_scale(robot, motion, axis), motion.qd[:, axis]
    if np.abs(qd).max() < least:
        return np.zeros(len(qd), dtype=bool)
    return motion.away_from(np.abs(motion.smoothed(qd)) < least)


def usable(robot: Robot, motion: Motion, axis: int, thinned: int = 1) -> Mask:
    """Return a mask of an axis's samples away from reversals and corners, shape (n,).

    At a corner the window averages the errors of the differences over several samples. If SYNC is
    slow, few remain: of a step of acceleration, the error is 20 % at 16 ms and 8 % at 4 ms. Then
    samples within reach of a corner are not used, and corners of other axes count too, unless the
    remaining samples show less than half the acceleration of an axis: a quarter of the information.

    `thinned` is the number of SYNCs per sample of a motion without errors of differences.
    """
    away = moving(robot, motion, axis)
    if not away.any():
        return away
    if motion.period / thinned <= LONGEST:
        acceleration = motion.smoothed(motion.qdd[:, axis])
        jerk = np.abs(np.gradient(acceleration, motion.period))
        own: Mask = jerk < JERK * limit_or_reached(robot.acceleration_limit[axis], acceleration)
        return away & own
    acceleration = motion.smoothed(motion.qdd)
    jerk = np.abs(np.gradient(acceleration, motion.period, axis=0))
    limits = zip(robot.acceleration_limit, acceleration.T, strict=True)
    corner: Mask = jerk >= JERK * np.array([limit_or_reached(float(x), own) for x, own in limits])
    steady = away & ~corner[:, axis]
    clear = steady & ~widen(np.any(corner, axis=1), len(SECOND) // 2)
    with_corners = np.abs(acceleration[:, corner.any(axis=0)])
    shown, left = (with_corners[used].max(axis=0, initial=0.0) for used in (steady, clear))
    return clear if (left >= shown / 2.0).all() else steady


def place(robot: Robot, axis: int) -> Indices:
    """Return the indices of base parameters and an axis's common terms among all unknowns."""
    return axis_place(len(base_parameters(robot)), N_COMMON, axis)


def n_unknowns(robot: Robot) -> int:
    """Return the number of base parameters and common terms of all axes."""
    return len(base_parameters(robot)) + robot.n_joints * N_COMMON
