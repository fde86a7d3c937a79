"""How friction turns round after a reversal, while it is not known over what distance.

Teeth and bristles bend before they slip: friction's direction follows the velocity's sign over a
presliding distance d, after Dahl

    dz/ds = (sign - z) / d,    s being the way,

from sample to sample as an exponential. Which distance is that of an axis shows in its torque after
reversals, so directions are found for a row of distances, and the one that fits best is taken.
What its neighbours in the row say otherwise is how uncertain the direction is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

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


class Turning:
    """Directions of friction of all axes, and the distance of each.

    Parameters
    ----------
    known : ndarray, shape (n_joints,)
        Presliding distances that the model holds, 0 where it holds none [rad or m].

    Attributes
    ----------
    direction, doubt : ndarray, shape (n_joints,)
        Directions from -1 to 1, and by how much they may be wrong.
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
        self.direction = self.doubt = np.zeros(n)

    @property
    def distance(self) -> Array:
        """Presliding distances that are taken, shape (n_joints,) [rad or m]."""
        return np.asarray(DISTANCES[self._taken])

    def take(self, step: Array) -> None:
        """Take by how much positions have changed since the last sample, shape (n_joints,)."""
        sign = np.sign(step)
        kept = np.exp(np.abs(step) / -DISTANCES[:, np.newaxis])
        self._row = sign - (sign - self._row) * kept
        slower = self._row[np.minimum(self._taken + 1, len(DISTANCES) - 1), self._axes]
        faster = self._row[np.maximum(self._taken - 1, 0), self._axes]
        self.direction = self._row[self._taken, self._axes]
        self.doubt = np.abs(slower - faster)

    def learn(self, friction: Array, level: Array) -> None:
        """Take what friction was in the same sample; as often as possible."""
        turning = (np.abs(self._row[-1] - self._row[0]) > TURNED) & (level > 0)
        if turning.any():
            self._misfit += turning * (friction - self._row * level) ** 2
            self._seen += turning

    def settle(self) -> None:
        """Take the distance that fits best of each axis whose turning has been seen."""
        shown = ~self._known & (self._seen >= ENOUGH)
        self._taken = np.where(shown, self._misfit.argmin(axis=0), self._taken)
