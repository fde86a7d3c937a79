"""How friction turns round after a reversal, while it is not known over what distance.

Teeth and bristles bend before they slip: friction's direction follows the velocity's sign over a
presliding distance d, after Dahl

    dz/ds = (sign - z) / d,    s being the way,

from sample to sample as an exponential. Which distance is that of an axis shows in its torque after
reversals, so directions are found for a row of distances, and the one that fits best is taken.
What its neighbours in the row say otherwise is how uncertain the direction is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

DISTANCES = 5e-5 * 2.0 ** np.arange(9)
"""Presliding distances that are tried [rad or m]."""
TURNED = 0.05
"""Difference of directions between neighbours in the row from which an axis counts as turning."""
ENOUGH = 25
"""Samples in the middle of turning from which a distance is taken."""


class Turned(NamedTuple):
    """Directions of friction from -1 to 1, and by how much they may be wrong, (n, n_joints)."""

    direction: Array
    doubt: Array


class Turning:
    """Directions of friction of all axes, and the distance of each.

    Parameters
    ----------
    known : ndarray, shape (n_joints,)
        Presliding distances that the model holds, 0 where it holds none [rad or m].
    """

    def __init__(self, known: Array) -> None:
        n = len(known)
        self._row = np.zeros((len(DISTANCES), n))
        self._misfit = np.zeros((len(DISTANCES), n))
        self._seen = np.zeros(n)
        self._known = known > 0
        nearest = np.abs(np.log(DISTANCES[:, np.newaxis] / np.where(self._known, known, 1e-3)))
        self._taken = nearest.argmin(axis=0)
        self._axes = np.arange(n)

    @property
    def distance(self) -> Array:
        """Presliding distances that are taken, shape (n_joints,) [rad or m]."""
        return np.asarray(DISTANCES[self._taken])

    def take(self, step: Array, friction: Array, level: Array) -> Turned:
        """Take samples in their order.

        Parameters
        ----------
        step : ndarray, shape (n, n_joints)
            By how much positions have changed since the sample before [rad or m].
        friction, level : ndarray, shape (n, n_joints)
            What friction was, and its level by the law [N m or N].
        """
        rows = self._directions(step)
        self._learn(rows, friction, level)
        slower = rows[:, np.minimum(self._taken + 1, len(DISTANCES) - 1), self._axes]
        faster = rows[:, np.maximum(self._taken - 1, 0), self._axes]
        return Turned(rows[:, self._taken, self._axes], np.abs(slower - faster))

    def settle(self) -> None:
        """Take the distance that fits best of each axis whose turning has been seen."""
        shown = ~self._known & (self._seen >= ENOUGH)
        self._taken = np.where(shown, self._misfit.argmin(axis=0), self._taken)

    def _directions(self, step: Array) -> Array:
        """Directions with every distance, shape (n, n_distances, n_joints)."""
        signs = np.sign(step)
        kept = np.exp(np.abs(step)[:, np.newaxis] / -DISTANCES[:, np.newaxis])
        rows = np.empty_like(kept)
        for row, sign, share in zip(rows, signs, kept, strict=True):
            row[:] = self._row = sign - (sign - self._row) * share
        return np.asarray(rows)

    def _learn(self, rows: Array, friction: Array, level: Array) -> None:
        turning = (np.abs(rows[:, -1] - rows[:, 0]) > TURNED) & (level > 0)
        if turning.any():
            error = (friction[:, np.newaxis] - rows * level[:, np.newaxis]) ** 2
            self._misfit += np.sum(turning[:, np.newaxis] * error, axis=0)
            self._seen += turning.sum(axis=0)
