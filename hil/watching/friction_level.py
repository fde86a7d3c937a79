"""What friction has become since the model was identified: followed slowly, axis by axis.

Temperature and lubricant change a level of friction by a tenth and more, in minutes. A push comes
within milliseconds and goes. So a few shares of the law's friction are unknowns that wander, each a
random walk, and a Kalman filter follows them block by block:

    residual / limit = z level (x0 + x1 u + x2 arctan(u / 0.08)) / limit + x3,

with direction z and speed u as a share of the velocity limit. It begins with what the model says
of the uncertainty of its friction. What the filter says of its own is part of every threshold.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

BEND = 0.08
"""Share of the velocity limit at which the arc tangent bends."""
LEAST = (0.02, 0.05, 0.05, 0.01)
"""Standard deviations at the beginning, at least: shares of the level, and of the torque limit."""
WANDER = (0.05, 0.05, 0.03, 0.005)
"""Standard deviations of what the unknowns wander in a minute."""
ERROR = 0.004
"""Share of the torque limit by which the mean of a block errs that is no friction."""


class FrictionLevel:
    """Follows the friction of all axes.

    Parameters
    ----------
    uncertainty : ndarray, shape (n_joints,)
        Of the law's level, as a share of it.
    """

    def __init__(self, uncertainty: Array) -> None:
        n = len(uncertainty)
        self._x = np.zeros((n, len(LEAST)))
        spread = np.tile(LEAST, (n, 1))
        spread[:, 0] = np.maximum(spread[:, 0], uncertainty)
        self._covariance = spread[:, :, np.newaxis] ** 2 * np.eye(len(LEAST))

    def at(self, columns: Array) -> tuple[Array, Array]:
        """What friction adds to the law's, and its standard error, as shares of the torque limit.

        Parameters
        ----------
        columns : ndarray, shape (n, n_joints, 4)
            Those of `columns_of`.
        """
        spread = np.einsum("njk,jkl,njl->nj", columns, self._covariance, columns)
        return np.einsum("njk,jk->nj", columns, self._x), np.sqrt(spread)

    def follow(self, columns: Array, left: Array, used: Array, duration: float) -> None:
        """Take one block of samples.

        Parameters
        ----------
        columns : ndarray, shape (n, n_joints, 4)
        left : ndarray, shape (n, n_joints)
            Measured less predicted, with what was followed before, as shares of the torque limit.
        used : ndarray of bool, shape (n, n_joints)
        duration : float
            Of the block [s].
        """
        walk = np.diag(np.square(WANDER)) * duration / 60
        weight = used / (ERROR**2 * len(left))
        information = np.einsum("njk,nj,njl->jkl", columns, weight, columns)
        shown = np.einsum("njk,nj,nj->jk", columns, weight, left)
        before = self._covariance + walk
        narrowed = np.linalg.solve(np.eye(len(LEAST)) + before @ information, before)
        self._covariance = (narrowed + np.swapaxes(narrowed, 1, 2)) / 2
        self._x = self._x + np.einsum("jkl,jl->jk", self._covariance, shown)


def columns_of(direction: Array, level: Array, speed: Array) -> Array:
    """Columns of the unknowns, shape (n, n_joints, 4).

    Parameters
    ----------
    direction, level, speed : ndarray, shape (n, n_joints)
        Direction from -1 to 1, and shares of the torque and velocity limits.
    """
    columns = np.ones((*speed.shape, len(LEAST)))
    columns[..., 0] = friction = direction * level
    columns[..., 1] = friction * speed
    columns[..., 2] = friction * np.arctan(speed / BEND)
    return columns
