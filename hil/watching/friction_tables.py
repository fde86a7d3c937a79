"""A model's law of friction as tables over speed, so that one sample costs microseconds.

Friction at a speed is known for either direction. Half of their sum is no friction but an offset,
half of their difference is the level: friction is ``offset + direction * level``, whatever way the
direction turns round after a reversal (`hil.watching.turning`). Both are linear in the torque that
the axis transmits. Ripple is left out: its mean over a turn of the motor is zero.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.friction.direction import Direction
from hil.friction.law import friction_torque, friction_variance
from hil.results.torque_parts import known_friction

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.results.model import Model

    Array = NDArray[np.float64]

NODES = 401
FASTEST = 1.25
"""Share of the velocity limit up to which the tables reach; faster is as fast as that."""
ANGLES = 16
"""Angles of the motor over which ripple is averaged out."""


class FrictionTables:
    """Friction of all axes by speed.

    Parameters
    ----------
    model : Model

    Attributes
    ----------
    uncertainty : ndarray, shape (n_joints,)
        Greatest standard error of the level, as a share of it.
    slowest : ndarray, shape (n_joints,)
        Speeds below which the law was not found but goes on [rad/s or m/s].

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._law = known_friction(model, of_all=True)
        reach = FASTEST * model.robot.velocity_limit
        self._per_node = (NODES - 1) / reach
        speeds = np.linspace(0.0, 1.0, NODES)[:, np.newaxis] * reach
        free, loaded = self._both_ways(speeds, 0.0), self._both_ways(speeds, 1.0)
        tables = np.concatenate([free, loaded - free])
        self._tables = np.concatenate([tables[:, :-1], np.diff(tables, axis=1)])
        self._axes = np.arange(model.robot.n_joints)
        self.slowest = np.array(
            [axis.speeds[0] if axis and axis.speeds else 0.0 for axis in self._law.axes]
        )
        self.uncertainty = self._relative_error(speeds, free[1])

    def at(self, qd: Array, load: Array) -> tuple[Array, Array]:
        """Offset and level of friction of samples, each of shape (n, n_joints) [N m or N].

        Parameters
        ----------
        qd, load : ndarray, shape (n, n_joints)
            Velocities [rad/s or m/s] and torques of the rigid bodies [N m or N].
        """
        place = np.minimum(np.abs(qd) * self._per_node, NODES - 1.001)
        node = place.astype(np.intp)
        found = self._tables[:, node, self._axes]
        offset, level, offset_by_load, level_by_load = found[:4] + (place - node) * found[4:]
        heavy = np.abs(load)
        return offset + heavy * offset_by_load, np.maximum(level + heavy * level_by_load, 0.0)

    def _both_ways(self, speeds: Array, load: float) -> Array:
        """Offset and level at a load, shape (2, NODES, n_joints)."""
        forth, back = (self._one_way(sign, speeds, load) for sign in (1.0, -1.0))
        return np.stack([forth + back, forth - back]) / 2

    def _one_way(self, sign: float, speeds: Array, load: float) -> Array:
        robot = self._model.robot
        turn = 2 * np.pi / np.nan_to_num(robot.gear_ratio, nan=1.0)
        direction = [Direction(np.full(NODES, sign), np.zeros(NODES))] * robot.n_joints
        loads = np.full(speeds.shape, load)
        ways = [
            friction_torque(
                robot, self._law, np.tile(share * turn, (NODES, 1)), sign * speeds, loads, direction
            )
            for share in np.arange(ANGLES) / ANGLES
        ]
        return np.asarray(np.mean(ways, axis=0))

    def _relative_error(self, speeds: Array, level: Array) -> Array:
        none = np.zeros_like(speeds)
        variance = friction_variance(self._model.robot, self._law, none, speeds, none)
        share: Array = np.sqrt(variance[1:]) / np.maximum(level[1:], 1e-9)
        return np.asarray(share.max(axis=0))
