"""Friction after a reversal, with unknown presliding distance.

Teeth and bristles bend before they slip: friction's direction follows the velocity's sign over a
presliding distance d, after Dahl

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

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.arrays import Array

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
        rows, unknown = self._directions(step, still)
        slip = qd[:, np.newaxis] - np.abs(qd)[:, np.newaxis] * rows
        turning = np.abs(rows[:, -1] - rows[:, 0]) > TURNING
        self._learn(turning & ~still & (level > 0), rows, slip, friction, level)
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

    def _directions(self, step: Array, still: Flags) -> tuple[Array, Array]:
        """Compute directions for every distance, and the doubt after standstills for that in use.

        Shapes (n, n_distances, n_joints) and (n, n_joints).
        """
        signs = np.sign(step)
        kept = np.exp(np.abs(step)[:, np.newaxis] / -DISTANCES[:, np.newaxis])
        left = kept[:, self._neighbours[0], self._axes]
        rows, unknown = np.empty_like(kept), np.empty_like(step)
        for i, (sign, share) in enumerate(zip(signs, kept, strict=True)):
            rows[i] = self._row = sign - (sign - self._row) * share
            held = 1.0 + np.abs(self._row[self.taken, self._axes])
            unknown[i] = self._open = np.where(still[i], held, self._open * left[i])
        return rows, unknown

    def _learn(self, used: Flags, rows: Array, slip: Array, friction: Array, level: Array) -> None:
        if used.any():
            error = friction[:, np.newaxis] - rows * level[:, np.newaxis]
            shown = np.stack([error**2, error * slip, slip**2, np.ones_like(error)])
            self._new += np.sum(used[:, np.newaxis] * shown, axis=1)
