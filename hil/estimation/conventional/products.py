"""Trajectories condensed to inner products, period by period and axis by axis.

Every method here needs of millions of samples only the inner products of torque, regressor and
instruments. So each axis's share of each period becomes one small matrix over the columns

    y | A(q, qd, qdd), friction | A(q_r, qd_r, qdd_r), friction_r

with y the torque less the motor's part and a friction known beforehand, and the subscript r the
motion that was commanded, which knows nothing of the noise: the instruments. All columns pass the
same phase-neutral filter as the torque does. The command is shifted by the delay of the drives,
found as the one at which it resembles the measured motion most.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.condensed import groups
from hil.estimation.conventional.friction_terms import compensated, friction_columns
from hil.estimation.signals import signals
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.model.motors import motor_torque
from hil.regression.least_squares import eliminated

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.conventional.friction_terms import Characteristic, Terms
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

DELAYS = np.linspace(0.0, 0.02, 41)
"""Delays of the drives that are tried [s]."""
THINNED = 3
"""Every n-th sample is used: the filter leaves nothing in between."""


@dataclass(frozen=True, slots=True, eq=False)
class Products:
    """Inner products of all columns.

    Attributes
    ----------
    blocks : ndarray, shape (n_blocks, n_joints, n_columns, n_columns)
        Of each period and axis.
    counts : ndarray, shape (n_blocks, n_joints)
        Samples behind them.
    n_base, n_friction : int
        Columns of base parameters, and of one axis's friction.
    n_trajectories : int
    """

    blocks: Array
    counts: Array
    n_base: int
    n_friction: int
    n_trajectories: int

    def first(self, n_friction: int) -> Products:
        """The same with no more than the first columns of friction."""
        width, own = self.n_base + self.n_friction, np.arange(self.n_base + n_friction)
        kept = np.concatenate([[0], 1 + own, 1 + width + own])
        return replace(self, blocks=self.blocks[..., kept[:, None], kept], n_friction=n_friction)

    def by_period(self, n_local: int) -> Products:
        """The same with the first columns of friction eliminated, block by block; no instruments.

        So each period has coefficients of its own for them.
        """
        begin, end = 1 + self.n_base, 1 + self.n_base + self.n_friction
        order = np.r_[:begin, begin + n_local : end, begin : begin + n_local]
        blocks = [
            [eliminated(product[np.ix_(order, order)], n_local)[0] for product in block]
            for block in self.blocks
        ]
        return replace(
            self,
            blocks=np.array(blocks),
            counts=self.counts - n_local,
            n_friction=self.n_friction - n_local,
        )


def products(
    robot: Robot,
    recorded: Sequence[tuple[Trajectory, Recording]],
    terms: Terms,
    slowest: float = 0.0,
    characteristics: Sequence[Characteristic] | None = None,
) -> Products:
    """Condense recordings of trajectories.

    Parameters
    ----------
    terms : str
        Friction that is fitted jointly.
    slowest : float
        Samples of an axis below this share of its speed limit are left out.
    characteristics : sequence of callable, optional
        Friction that is subtracted beforehand, one for each axis.
    """
    blocks, counts = [], []
    for trajectory, recording in recorded:
        s = signals(recording)
        known = compensated(s, characteristics) if characteristics else 0.0
        y = s.tau - motor_torque(robot, s.q, s.qd, s.qdd) - known
        commanded = _commanded(trajectory, s)
        axes = [
            _axis(robot, s, y[:, axis], commanded, axis, terms, slowest)
            for axis in range(robot.n_joints)
        ]
        for group in groups(s):
            period = np.flatnonzero(s.valid & group)[::THINNED]
            shares = [stacked[period[used[period]]] for stacked, used in axes]
            blocks.append([share.T @ share for share in shares])
            counts.append([len(share) for share in shares])
    n_base, n_friction = len(base_parameters(robot)), _n_friction(robot, terms)
    return Products(
        np.array(blocks), np.array(counts, dtype=float), n_base, n_friction, len(recorded)
    )


def _n_friction(robot: Robot, terms: Terms) -> int:
    still = np.zeros((1, robot.n_joints))
    return int(friction_columns(robot, still, still, 0, terms, np.zeros(1)).shape[1])


def _axis(
    robot: Robot,
    s: Signals,
    y: Array,
    commanded: tuple[Array, Array, Array],
    axis: int,
    terms: Terms,
    slowest: float,
) -> tuple[Array, NDArray[np.bool_]]:
    """All columns of one axis, filtered, and which samples count."""
    stacked = [y[:, np.newaxis]]
    for q, qd, qdd in ((s.q, s.qd, s.qdd), commanded):
        direction = np.sign(s.smoothed(qd[:, axis]))
        stacked.append(regressor(robot, q, qd, qdd, joints=[axis])[:, 0])
        stacked.append(friction_columns(robot, q, qd, axis, terms, direction))
    slow = np.abs(s.smoothed(s.qd[:, axis])) < slowest * robot.velocity_limit[axis]
    used = s.away_from(slow) if slowest else np.ones(len(y), dtype=bool)
    return s.smoothed(np.hstack(stacked)), used


def _commanded(trajectory: Trajectory, s: Signals) -> tuple[Array, Array, Array]:
    """Motion that was commanded, at the samples' times less the drives' delay."""
    t = s.time - s.time[int(np.argmax(s.under_way))]
    end = trajectory.cycles * trajectory.period
    moving = np.flatnonzero(s.under_way)[::THINNED]
    apart = [
        float(np.sum((trajectory.motion(t[moving] - delay)[0] - s.q[moving]) ** 2))
        for delay in DELAYS
    ]
    return trajectory.motion(np.clip(t - DELAYS[int(np.argmin(apart))], 0.0, end))
