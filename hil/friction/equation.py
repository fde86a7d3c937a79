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
motor's angle (zero at those that look like something else, `hil.friction.ripple`), and friction
that grows with the transmitted torque, |Q_t| sign(v) and, where that differs by direction, |Q_t|.
What is transmitted is not known before there is a first estimate, so these two are zero here, and
the estimator fills them in.

Left out are samples near a reversal, where friction is no function of velocity, and those where the
acceleration changes fast, at the corners of the trapezoid: there, differences of positions and
samples of the torque do not show the same instant.

None of this needs a torque. So it is the same for a motion that was measured
(`hil.estimation.signals`) and for one that is planned
(`hil.planning.prediction.information`).
"""

from __future__ import annotations

from math import isnan
from typing import TYPE_CHECKING, Protocol

import numpy as np

from hil.friction.direction import at_once
from hil.friction.ripple import RIPPLE_ORDERS, ripple_orders
from hil.friction.terms import DIRECTED, DRIFT, LOAD_BY_DIRECTION, friction_columns
from hil.least_squares.layout import axis_place
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from hil.arrays import Array, Indices, Mask
    from hil.model.robot import Robot


OWN = (*(term for term in DIRECTED if term != "load"), DRIFT)
"""Terms of the friction of one measurement alone, the columns of F."""
COMMON = (
    "offset", "asymmetric",
    *(f"{wave} {order}" for wave in ("cosine", "sine") for order in RIPPLE_ORDERS),
    "load", LOAD_BY_DIRECTION,
)  # fmt: skip
"""Terms that all measurements of an axis share, the columns of G."""
ASYMMETRIC = tuple(COMMON.index(term) for term in ("offset", "asymmetric"))
"""Places of the columns of G by which friction differs by direction."""
LOAD = COMMON.index("load")
"""Place of the column of G that grows with the transmitted torque; its coefficient is mu."""
N_COMMON = len(COMMON)
"""Columns of G of one axis."""
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


def rows_of(robot: Robot, motion: Motion, axis: int) -> Array:
    """Columns of an axis's base parameters, shape (n, n_base)."""
    return regressor(robot, *motion.link, joints=[axis])[:, 0]


def term_columns(
    robot: Robot, motion: Motion, axis: int, rows: Array | None = None
) -> tuple[Array, Array, Array]:
    """Columns of an axis's base parameters, common terms and friction, each of shape (n, ...).

    Base parameters' are the `rows`, where these are known.
    """
    rows = rows_of(robot, motion, axis) if rows is None else rows
    v = motion.qd[:, axis] / speed_scale(robot, motion, axis)
    seen = (*COMMON[:2], *(f"{wave} {n}" for wave in ("cosine", "sine")
                           for n in ripple_orders(robot, axis)))  # fmt: skip
    angle, common = robot.gear_ratio[axis] * motion.q[:, axis], np.zeros((len(v), N_COMMON))
    places = [COMMON.index(term) for term in seen]
    common[:, places] = friction_columns(v, at_once(v, 0.0), angle=angle, terms=seen)
    return rows, common, own_friction(motion, v)


def own_friction(motion: Motion, v: Array) -> Array:
    """F: what friction of one measurement can be, shape (n, 6).

    Parameters
    ----------
    v : ndarray, shape (n,)
        Velocity of the axis as share of its limit.
    """
    free_of_noise = motion.smoothed(v)
    distance = np.cumsum(np.abs(free_of_noise))
    gone = (distance - distance.mean()) / max(float(np.ptp(distance)), motion.period)
    return friction_columns(v, at_once(free_of_noise, 0.0), gone=gone, terms=OWN)


def speed_scale(robot: Robot, motion: Motion, axis: int) -> float:
    """Speed limit of an axis; where that is unknown, its greatest speed in the motion."""
    limit = float(robot.velocity_limit[axis])
    return limit_or_reached(limit, motion.smoothed(motion.qd[:, axis])) if isnan(limit) else limit


def limit_or_reached(limit: float, x: Array) -> float:
    """Limit of a quantity; where that is unknown (NaN), the greatest size that it has, above 0."""
    reached = max(float(np.abs(x).max(initial=0.0)), float(np.finfo(float).tiny))
    return reached if np.isnan(limit) else float(limit)


def moving(robot: Robot, motion: Motion, axis: int) -> Mask:
    """Samples of an axis away from reversals, shape (n,)."""
    least, qd = SLOW * speed_scale(robot, motion, axis), motion.qd[:, axis]
    if np.abs(qd).max() < least:
        return np.zeros(len(qd), dtype=bool)
    return motion.away_from(np.abs(motion.smoothed(qd)) < least)


def usable(robot: Robot, motion: Motion, axis: int) -> Mask:
    """Samples of an axis in steady motion, away from reversals and corners, shape (n,)."""
    away = moving(robot, motion, axis)
    if not away.any():
        return away
    acceleration = motion.smoothed(motion.qdd[:, axis])
    jerk = np.abs(np.gradient(acceleration, motion.period))
    steady: Mask = jerk < JERK * limit_or_reached(robot.acceleration_limit[axis], acceleration)
    return away & steady


def place(robot: Robot, axis: int) -> Indices:
    """Where base parameters and an axis's common terms stand among all unknowns."""
    return axis_place(len(base_parameters(robot)), N_COMMON, axis)


def n_unknowns(robot: Robot) -> int:
    """Base parameters and, axis by axis, the common terms."""
    return len(base_parameters(robot)) + robot.n_joints * N_COMMON
