"""Friction during a watch: the model's law by speed, tracked deviation, and reversals.

Friction at a speed is known for either direction. Half of their sum is an offset, half of their
difference is the level: friction is ``offset + direction * level``, also while the direction
reverses. Both are linear in the transmitted torque. Torque ripple is left out: its mean over a turn
of the motor is zero. With tables one sample costs microseconds.

Temperature and lubricant change a friction level by a tenth and more, in minutes, and a friction
law is never exact. A push comes within milliseconds and ends. So the deviation of friction from the
law is unknown at a row of speeds, linear between them, and wanders; a Kalman filter tracks it block
by block:

    residual / limit = z level x(u) / limit + offset,

with direction z and speed u as a share of the velocity limit. Neighbours in the row are correlated.
The initial covariance comes from the model's uncertainty of friction. The filter's own uncertainty
is part of every threshold.

After a reversal the presliding distance is unknown. Teeth and bristles bend before they slip:
friction's direction follows the velocity's sign over a presliding distance d, after Dahl

    dz/ds = (sign - z) / d,    s being the distance,

from sample to sample as an exponential. Bending teeth and bristles are damped, after Canudas de Wit
et al. (IEEE Trans. Automat. Contr. 40, 1995), which adds a torque

    c (v - |v| z)

to that of z. If an axis reverses within few samples, at the end of a stroke, the torque of damping
is larger than friction itself. Distance and damping of an axis show in its torque after reversals,
so directions are computed for a row of distances, each with its fitted damping, and the best
fitting distance is used. The difference between the neighbouring distances of the row, plus a share
of the damping, is the uncertainty of the direction.

At a standstill the direction of friction follows the torque, invisible to an encoder. The direction
stays unknown until the axis has moved over the presliding distance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.friction.direction import Direction
from hil.friction.law import friction_torque, friction_variance
from hil.results.identified_robot import known_friction

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.results.model import Model

    Flags = NDArray[np.bool_]


DISTANCES = 5e-5 * 2.0 ** np.arange(9)
"""Candidate presliding distances [rad or m]."""
DAMPING_DOUBT = 0.3
"""Uncertainty of the damping, relative to the damping (`Turning.take`)."""
ENOUGH = 25
"""Minimum number of samples after reversals for the choice of a distance."""
TURNING = 0.05
"""Difference between the directions of the extreme distances, from which on an axis reverses."""
UNKNOWN = 1e3
"""Doubt about an unknown direction: no push is visible."""


class Turned(NamedTuple):
    """Friction during a reversal, with shapes (n, n_joints).

    Attributes
    ----------
    direction : ndarray
        Direction from -1 to 1.
    damping : ndarray
        Torque of the damping, in addition to that of the direction [N m or N].
    doubt : ndarray
        Possible error of direction and damping together, relative to the friction level.
    """

    direction: Array
    damping: Array
    doubt: Array


class Turning:
    """Friction directions of the axes, with presliding distance and damping.

    Parameters
    ----------
    known : ndarray, shape (n_joints,)
        Presliding distances of the model, 0 if unknown [rad or m].
    period : float
        Time between two samples [s].
    still : float
        Time within the shortest distance after which an axis counts as being at rest [s].

    Attributes
    ----------
    sums : ndarray, shape (4, n_distances, n_joints)
        Sums over the samples after reversals, for the fit of distance and damping: squares of
        friction's error, products with the slip speed, squares of the slip speed, and number.
    taken : ndarray of int, shape (n_joints,)
        Positions of the distances in use in `DISTANCES`.
    known : ndarray of bool, shape (n_joints,)
        True for a distance known from the model.
    n_still : int
        Number of samples in `still`.
    """

    def __init__(self, known: Array, period: float, still: float = 0.1) -> None:
        n = len(known)
        self._row = np.zeros((len(DISTANCES), n))
        self.sums, self._new = np.zeros((2, 4, len(DISTANCES), n))
        self._shown = np.zeros(n, dtype=bool)
        self.known = known > 0
        nearest = np.abs(np.log(DISTANCES[:, np.newaxis] / np.where(self.known, known, 1e-3)))
        self.taken = nearest.argmin(axis=0)
        self._damping = np.zeros(n)
        self._axes = np.arange(n)
        self.n_still = max(2, round(still / period))
        self._recent = np.zeros((self.n_still, n))
        self._open = np.ones(n)

    @property
    def distance(self) -> Array:
        """Presliding distances in use, shape (n_joints,) [rad or m]."""
        return np.asarray(DISTANCES[self.taken])

    @property
    def damping(self) -> Array:
        """Damping in use, shape (n_joints,) [N m s/rad or N s/m]."""
        return self._damping

    def take(
        self,
        step: Array,
        qd: Array,
        friction: Array,
        level: Array,
        damping_doubt: float = DAMPING_DOUBT,
    ) -> Turned:
        """Process samples in order.

        Parameters
        ----------
        step : ndarray, shape (n, n_joints)
            Change of position since the last sample [rad or m].
        qd : ndarray, shape (n, n_joints)
            Velocities [rad/s or m/s].
        friction, level : ndarray, shape (n, n_joints)
            Observed friction, and its level by the law [N m or N].
        damping_doubt : float
            Uncertainty of the damping, relative to the damping. The damping is proportional to the
            square root of the stiffness, the stiffness to 1 / distance. Candidate distances are a
            factor of 2 apart, which changes the damping by 41 %. With 0.3 there is no false alarm
            in `benchmarks/pushes.py`; 0.5 hides more pushes.
        """
        # true for axes within the shortest distance
        length = len(self._recent)
        way = np.concatenate([self._recent, self._recent[-1] + step.cumsum(axis=0)])
        self._recent = way[-length:] - way[-1]
        windows = np.lib.stride_tricks.sliding_window_view(way[1:], length, axis=0)
        still = np.asarray(np.ptp(windows, axis=-1) < DISTANCES[0])
        # directions for every distance, and the doubt after standstills for that in use
        kept = np.exp(np.abs(step)[:, np.newaxis] / -DISTANCES[:, np.newaxis])
        left = kept[:, self._neighbours[0], self._axes]
        rows, unknown = np.empty_like(kept), np.empty_like(step)
        for i, (sign, share) in enumerate(zip(np.sign(step), kept, strict=True)):
            rows[i] = self._row = sign - (sign - self._row) * share
            held = 1.0 + np.abs(self._row[self.taken, self._axes])
            unknown[i] = self._open = np.where(still[i], held, self._open * left[i])
        slip = qd[:, np.newaxis] - np.abs(qd)[:, np.newaxis] * rows
        turning = np.abs(rows[:, -1] - rows[:, 0]) > TURNING
        if (used := turning & ~still & (level > 0)).any():
            error = friction[:, np.newaxis] - rows * level[:, np.newaxis]
            shown = np.stack([error**2, error * slip, slip**2, np.ones_like(error)])
            self._new += np.sum(used[:, np.newaxis] * shown, axis=1)
        slower, faster = self._neighbours
        apart = np.abs(rows[:, slower, self._axes] - rows[:, faster, self._axes])
        damping = self._damping * slip[:, self.taken, self._axes]
        doubt = np.maximum(apart, unknown)
        doubt += damping_doubt * np.abs(damping) / np.maximum(level, 1e-9)
        doubt[turning & ~self._shown] = UNKNOWN  # pushes are invisible before enough reversals
        return Turned(rows[:, self.taken, self._axes], damping, doubt)

    def settle(self, used: Flags | bool = True, enough: int = ENOUGH) -> None:
        """Use the new samples of `used` axes for fitting.

        The best fitting distance and damping of each axis are selected after `enough` samples.
        """
        self.sums += np.where(used, self._new, 0.0)
        self._new[:] = 0.0
        squares, products, slips, (seen, *_) = self.sums
        self._shown = seen >= enough
        damping = products.clip(0.0) / np.maximum(slips, 1e-12)
        best = (squares - damping * products).argmin(axis=0)
        self.taken = np.where(self._shown & ~self.known, best, self.taken)
        self._damping = np.where(self._shown, damping[self.taken, self._axes], 0.0)

    @property
    def _neighbours(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Slower and faster neighbours of the distances in use."""
        return np.minimum(self.taken + 1, len(DISTANCES) - 1), np.maximum(self.taken - 1, 0)


NODES = 401
LAST_PLACE = NODES - 1.001
"""Largest place in the tables."""


class FrictionTables:
    """Friction of the axes, tabulated by speed.

    Parameters
    ----------
    fastest : float
        Largest speed of the tables, as a share of the velocity limit; higher speeds are clipped.

    Attributes
    ----------
    uncertainty : ndarray, shape (n_joints,)
        Greatest standard error of the level, relative to the level.
    slowest : ndarray, shape (n_joints,)
        Speeds below which the law is extrapolated [rad/s or m/s].
    values : ndarray, shape (4, n_nodes, n_joints)
        Offset and level by speed [N m or N], and their change by a load of 1 N m or N.
    per_node : ndarray, shape (n_joints,)
        Number of nodes per speed [s/rad or s/m].

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """

    def __init__(self, model: Model, fastest: float = 1.25) -> None:
        self._model = model
        self._law = known_friction(model, of_all=True)
        reach = fastest * model.robot.velocity_limit
        self.per_node = (NODES - 1) / reach
        speeds = np.linspace(0.0, 1.0, NODES)[:, np.newaxis] * reach
        free, loaded = self._both_ways(speeds, 0.0), self._both_ways(speeds, 1.0)
        self.values = np.concatenate([free, loaded - free])
        self._tables = np.concatenate([self.values[:, :-1], np.diff(self.values, axis=1)])
        self._axes = np.arange(model.robot.n_joints)
        self.slowest = np.array(
            [axis.speeds[0] if axis and axis.speeds else 0.0 for axis in self._law.axes]
        )
        level = free[1]
        none = np.zeros_like(speeds)
        variance = friction_variance(self._model.robot, self._law, none, speeds, none)
        share: Array = np.sqrt(variance[1:]) / np.maximum(level[1:], 1e-9)
        self.uncertainty = np.asarray(share.max(axis=0))

    def evaluate(self, qd: Array, load: Array) -> tuple[Array, Array]:
        """Return offset and level of friction, shapes (n, n_joints) [N m or N].

        Parameters
        ----------
        qd, load : ndarray, shape (n, n_joints)
            Velocities [rad/s or m/s] and torques of the rigid bodies [N m or N].
        """
        place = np.minimum(np.abs(qd) * self.per_node, LAST_PLACE)
        node = place.astype(np.intp)
        found = self._tables[:, node, self._axes]
        offset, level, offset_by_load, level_by_load = found[:4] + (place - node) * found[4:]
        heavy = np.abs(load)
        return offset + heavy * offset_by_load, np.maximum(level + heavy * level_by_load, 0.0)

    def _both_ways(self, speeds: Array, load: float) -> Array:
        """Compute offset and level at a load, shape (2, NODES, n_joints)."""
        robot, angles = self._model.robot, 16
        turn = 2 * np.pi / np.nan_to_num(robot.gear_ratio, nan=1.0)
        ways = []
        for sign in (1.0, -1.0):
            direction = [Direction(np.full(NODES, sign), np.zeros(NODES))] * robot.n_joints
            motion = sign * speeds, np.full(speeds.shape, load), direction
            # torque ripple is averaged over motor angles
            at_angles = [
                friction_torque(robot, self._law, np.tile(share * turn, (NODES, 1)), *motion)
                for share in np.arange(angles) / angles
            ]
            ways.append(np.mean(at_angles, axis=0))
        forth, back = ways
        return np.stack([forth + back, forth - back]) / 2


SPEEDS = np.array([0.0, 0.01, 0.03, 0.07, 0.15, 0.3, 0.6, 1.2])
"""Speeds of the unknown friction deviation, as shares of the velocity limit; constant beyond."""
LEVEL, SHAPE, OFFSET = 0.02, 0.05, 0.01
"""Minimum initial standard deviations: level and shape relative to the friction level, offset
relative to the torque limit."""
LEVEL_WANDER, SHAPE_WANDER, OFFSET_WANDER = 0.05, 0.04, 0.005
"""Standard deviations of the random walk per minute, in the same units."""
ERROR = 0.004
"""Error of a block's mean not due to friction, as a share of the torque limit."""
N_UNKNOWNS = len(SPEEDS) + 1
"""Number of unknowns: friction deviation by speed, and offset."""


class FrictionLevel:
    """Kalman filter for the friction of the axes.

    Parameters
    ----------
    uncertainty : ndarray, shape (n_joints,)
        Uncertainty of the law's level, relative to the level.
    slowest : ndarray, shape (n_joints,)
        Smallest speeds of the law's data, as shares of the velocity limit.

    Attributes
    ----------
    covariance : ndarray, shape (n_joints, n_unknowns, n_unknowns)
        Covariance of the unknowns.
    wander : ndarray, shape (n_unknowns, n_unknowns)
        Covariance of their random walk over a minute.
    """

    def __init__(self, uncertainty: Array, slowest: Array) -> None:
        self._x = np.zeros((len(uncertainty), N_UNKNOWNS))
        below = np.clip(1.0 - SPEEDS / np.maximum(slowest, 1e-9)[:, np.newaxis], 0.0, 1.0)
        shape = np.maximum(SHAPE, 0.2 * below)  # far below the speeds of the law's data
        self.covariance = np.stack(
            [
                _covariance(max(LEVEL, own), spread, OFFSET)
                for own, spread in zip(uncertainty, shape, strict=True)
            ]
        )
        even = np.full(len(SPEEDS), SHAPE_WANDER)
        self.wander = _covariance(LEVEL_WANDER, even, OFFSET_WANDER)

    def evaluate(self, columns: Array) -> tuple[Array, Array]:
        """Return friction deviation and standard error, as shares of the torque limit.

        Parameters
        ----------
        columns : ndarray, shape (n, n_joints, n_unknowns)
            Columns from `columns_of`.
        """
        spread = np.einsum("njk,jkl,njl->nj", columns, self.covariance, columns)
        return np.einsum("njk,jk->nj", columns, self._x), np.sqrt(spread)

    def follow(
        self, columns: Array, left: Array, used: Array, duration: float, error: float = ERROR
    ) -> None:
        """Update by a block of samples.

        Parameters
        ----------
        columns : ndarray, shape (n, n_joints, n_unknowns)
        left : ndarray, shape (n, n_joints)
            Measured less predicted torque, including the deviation tracked before, as a share of
            the torque limit.
        used : ndarray of bool, shape (n, n_joints)
        duration : float
            Duration of the block [s].
        error : float
            Error of a block's mean not due to friction, as a share of the torque limit.
        """
        walk = self.wander * duration / 60
        weight = used / (error**2 * len(left))
        information = np.einsum("njk,nj,njl->jkl", columns, weight, columns)
        shown = np.einsum("njk,nj,nj->jk", columns, weight, left)
        before = self.covariance + walk
        narrowed = np.linalg.solve(np.eye(N_UNKNOWNS) + before @ information, before)
        self.covariance = (narrowed + np.swapaxes(narrowed, 1, 2)) / 2
        self._x = self._x + np.einsum("jkl,jl->jk", self.covariance, shown)


def columns_of(direction: Array, level: Array, speed: Array) -> Array:
    """Return the columns of the unknowns, shape (n, n_joints, n_unknowns).

    Parameters
    ----------
    direction, level, speed : ndarray, shape (n, n_joints)
        Direction from -1 to 1, and shares of the torque and velocity limits.
    """
    columns = np.empty((*speed.shape, N_UNKNOWNS))
    place = np.interp(speed, SPEEDS, np.arange(len(SPEEDS)))
    near = np.abs(place[..., np.newaxis] - np.arange(len(SPEEDS)))
    columns[..., :-1] = (direction * level)[..., np.newaxis] * np.maximum(1.0 - near, 0.0)
    columns[..., -1] = 1.0
    return columns


def _covariance(level: float, shape: Array, offset: float, alike: float = 2.0) -> Array:
    """Compute the covariance of the unknowns, shape (n_unknowns, n_unknowns).

    The correlation of the shape halves over `alike` steps of `SPEEDS`.
    """
    found = np.zeros((N_UNKNOWNS, N_UNKNOWNS))
    number = np.arange(len(SPEEDS))
    apart = np.abs(np.subtract.outer(number, number))
    found[:-1, :-1] = level**2 + np.outer(shape, shape) * 0.5 ** (apart / alike)
    found[-1, -1] = offset**2
    return found
