"""Trajectories condensed to inner products, by period and axis.

The methods need only the inner products of torque, regressor and instruments. So millions of
samples are reduced to one small matrix per axis and period, over the columns

    y | A(q, qd, qdd), friction | A(q_r, qd_r, qdd_r), friction_r

with y the torque less the motor's part and previously measured friction. Columns with subscript r
are computed from the commanded motion, which is independent of the noise: these are the
instruments. All columns pass the phase-neutral filter of the torque. The commanded motion is
shifted by the delay of the drives, estimated by its best fit to the measured motion.

The column of load friction needs base parameters and is zero at first. Therefore the filtered rows
are kept, and `Stacked.loaded` adds the inner products of this column for each new estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.condensed import groups
from hil.estimation.signals import signals
from hil.least_squares.solving import eliminated
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.model.motors import motor_torque

from .friction_terms import (
    DIRECTION,
    LOAD,
    N_FRICTION,
    compensated,
    friction_columns,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory
    from hil.runs.recording import Recording

    from .friction_terms import Characteristic

    Array = NDArray[np.float64]

DELAYS = np.linspace(0.0, 0.02, 41)
"""Tested delays of the drives [s]."""
THINNED = 3
"""Thinning ratio of the samples; the filtered signals have no content in between."""


@dataclass(frozen=True, slots=True, eq=False)
class Products:
    """Inner products of all columns.

    Attributes
    ----------
    blocks : ndarray, shape (n_blocks, n_joints, n_columns, n_columns)
        Inner products of each period and axis.
    counts : ndarray, shape (n_blocks, n_joints)
        Number of samples of each period and axis.
    n_base, n_friction : int
        Columns of base parameters, and of one axis's friction.
    n_trajectories : int
    """

    blocks: Array
    counts: Array
    n_base: int
    n_friction: int
    n_trajectories: int

    @property
    def plain(self) -> Array:
        """Products of torque and columns, without instruments."""
        width = 1 + self.n_base + self.n_friction
        return self.blocks[..., :width, :width]

    @property
    def crossed(self) -> Array:
        """Products of torque and instruments with torque and columns."""
        width = 1 + self.n_base + self.n_friction
        rows = np.r_[0, width : len(self.blocks[0, 0])]
        return self.blocks[..., rows, :width]

    def only(self, places: Sequence[int]) -> Products:
        """Return the products with these friction columns only."""
        width = self.n_base + self.n_friction
        own = np.r_[: self.n_base, self.n_base + np.array(places, dtype=int)]
        kept = np.concatenate([[0], 1 + own, 1 + width + own])
        return replace(self, blocks=self.blocks[..., kept[:, None], kept], n_friction=len(places))

    def eliminate_friction(self, n_local: int) -> Products:
        """Return products with friction columns eliminated by block; no instruments.

        Each period then has separate friction coefficients.
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


@dataclass(frozen=True, slots=True, eq=False)
class Stacked:
    """Recordings of trajectories with all columns, and their inner products.

    Attributes
    ----------
    rows : sequence of sequence of ndarray, shape (n, n_columns)
        Samples of each period and axis.
    products : Products
        Without friction of the load.
    """

    rows: Sequence[Sequence[Array]]
    products: Products

    def loaded(self, p: Array) -> Products:
        """Return inner products with the column ``|Q_t| sign(qd)``, Q_t by base parameters `p`.

        Q_t is the smoothed torque of the links, whose absolute value is not that of noise; the
        instrument is the same column along the commanded motion.
        """
        n, width = self.products.n_base, self.products.n_base + N_FRICTION
        first = np.array([1, 1 + width])
        places = first + n + LOAD
        blocks = self.products.blocks.copy()
        for block, rows in zip(blocks, self.rows, strict=True):
            for product, columns in zip(block, rows, strict=True):
                load = np.stack(
                    [
                        np.abs(columns[:, k : k + n] @ p) * columns[:, k + n + DIRECTION]
                        for k in first
                    ],
                    axis=1,
                )
                product[:, places] = columns.T @ load
                product[places] = product[:, places].T
                product[np.ix_(places, places)] = load.T @ load
        return replace(self.products, blocks=blocks)


def stack(
    robot: Robot,
    recorded: Sequence[tuple[Trajectory, Recording]],
    slowest: float = 0.0,
    characteristics: Sequence[Characteristic] | None = None,
) -> Stacked:
    """Stack and condense recordings of trajectories.

    Parameters
    ----------
    slowest : float
        Samples of an axis below this share of its speed limit are left out.
    characteristics : sequence of callable, optional
        Friction that is subtracted beforehand, one for each axis.
    """
    rows: list[tuple[Array, ...]] = []
    for trajectory, recording in recorded:
        s = signals(recording)
        known = compensated(s, characteristics) if characteristics else 0.0
        y = s.tau - motor_torque(robot, s.q, s.qd, s.qdd) - known
        commanded = _commanded(trajectory, s)
        periods = [np.flatnonzero(s.valid & group)[::THINNED] for group in groups(s)]
        axes = [
            _axis(robot, s, y[:, axis], commanded, axis, periods, slowest)
            for axis in range(robot.n_joints)
        ]
        rows.extend(zip(*axes, strict=True))
    condensed = Products(
        np.array([[columns.T @ columns for columns in axes] for axes in rows]),
        np.array([[float(len(columns)) for columns in axes] for axes in rows]),
        len(base_parameters(robot)),
        N_FRICTION,
        len(recorded),
    )
    return Stacked(rows, condensed)


def _axis(
    robot: Robot,
    s: Signals,
    y: Array,
    commanded: tuple[Array, Array, Array],
    axis: int,
    periods: Sequence[NDArray[np.intp]],
    slowest: float,
) -> list[Array]:
    """Return all filtered columns of one axis: the used samples of each period."""
    stacked = [y[:, np.newaxis]]
    for q, qd, qdd in ((s.q, s.qd, s.qdd), commanded):
        direction = np.sign(s.smoothed(qd[:, axis]))
        stacked.append(regressor(robot, q, qd, qdd, joints=[axis])[:, 0])
        stacked.append(friction_columns(robot, q, qd, axis, direction))
    slow = np.abs(s.smoothed(s.qd[:, axis])) < slowest * robot.velocity_limit[axis]
    used = s.away_from(slow) if slowest else np.ones(len(y), dtype=bool)
    columns = s.smoothed(np.hstack(stacked))
    return [columns[period[used[period]]] for period in periods]


def _commanded(trajectory: Trajectory, s: Signals) -> tuple[Array, Array, Array]:
    """Return the commanded motion, at the samples' times less the drives' delay."""
    t = s.time - s.time[int(np.argmax(s.active))]
    end = trajectory.cycles * trajectory.period
    moving = np.flatnonzero(s.active)[::THINNED]
    apart = [
        float(np.sum((trajectory.motion(t[moving] - delay)[0] - s.q[moving]) ** 2))
        for delay in DELAYS
    ]
    return trajectory.motion(np.clip(t - DELAYS[int(np.argmin(apart))], 0.0, end))
