"""Unknowns of free motions: those that all axes share, then each axis's friction, by its law.

Normal equations (`hil.regression.normal_equations`) are of all terms of friction that there are. A
law is a choice among them, which costs no more than to leave rows and columns out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.friction_terms import BENT, COLUMNS
from hil.regression.normal_equations import mean_squares, normal, reweighted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]

ASIDE = 0.01
"""Share w of the samples under way that go in the other direction, below which an axis moves in one
direction only: there offset and Coulomb friction are at least sqrt(1 / w + 1) / 2 = 5 times as
uncertain as their sum."""


def kept_unknowns(n_shared: int, laws: Sequence[Sequence[str]]) -> Indices:
    """Unknowns that laws of friction, one for each axis, leave.

    With Coulomb's friction there is how it bends, whose column is 0 where it turns round at once.
    """
    own = [
        n_shared + axis * len(COLUMNS) + COLUMNS.index(term)
        for axis, law in enumerate(laws)
        for term in ((*law, BENT) if "Coulomb" in law else law)
    ]
    return np.concatenate([np.arange(n_shared, dtype=np.intp), np.array(own, dtype=np.intp)])


def squares_left(products: Array, counts: Array, n_shared: int, x: Array) -> Array:
    """Mean square of what `x`, of all unknowns, leaves of each axis's torque, shape (n_joints,).

    Parameters
    ----------
    products : ndarray, shape (n_blocks, n_joints, m, m)
        The torque is column 0.
    counts : ndarray, shape (n_blocks, n_joints)
    """
    totals = [each.sum(axis=0) for each in np.swapaxes(products, 0, 1)]
    return mean_squares(totals, counts.sum(axis=0), n_shared, x)


def residual_weights(products: Array, counts: Array, n_shared: int, kept: Indices) -> Array:
    """Reciprocal residual variances of the axes, found by solving again and again."""
    squares = np.einsum("bjkk->jk", products)[:, 0]
    first: Array = counts.sum(axis=0) / np.maximum(squares, 1e-12)
    totals = products.sum(axis=0, keepdims=True), counts.sum(axis=0, keepdims=True)

    def weigh(weights: Array) -> Array:
        x = normal(totals[0], n_shared, weights).solution(kept)
        left = squares_left(*totals, n_shared, x)
        found = 1.0 / np.maximum(left, 1e-9 * squares / np.maximum(counts.sum(axis=0), 1.0))
        return np.asarray(np.where(np.isfinite(found), found, 0.0))

    return reweighted(weigh, first)


def only_directions(products: Array, n_shared: int) -> Array:
    """Direction, 1 or -1, in which alone each axis moves, shape (n_joints,); 0 where it moves both.

    The slowest class of speed does not count: friction of an axis at rest is any up to Coulomb's.
    """
    offset, Coulomb = (1 + n_shared + COLUMNS.index(term) for term in ("offset", "Coulomb"))
    total = products[:, :, 1:].sum(axis=(0, 2))
    excess, moving = total[:, offset, Coulomb], total[:, Coulomb, Coulomb]
    one: Array = np.where(np.abs(excess) > (1.0 - 2.0 * ASIDE) * moving, np.sign(excess), 0.0)
    return one


def split_covariance(directions: Array, n_shared: int, x: Array) -> Array:
    """Covariance of how offset and Coulomb friction share their sum, shape (n, n).

    On an axis that moves in one direction only either may be all of the sum, so each is uncertain
    by half of it.
    """
    found = np.zeros((len(x), len(x)))
    for axis in np.flatnonzero(directions):
        first = n_shared + int(axis) * len(COLUMNS)
        places = [first + COLUMNS.index(term) for term in ("offset", "Coulomb")]
        both = np.array([1.0, directions[axis]])
        exchanged = both @ x[places] / 2.0 * np.array([1.0, -directions[axis]])
        found[np.ix_(places, places)] = np.outer(exchanged, exchanged)
    return found


def summed(products: Array, slowest: int = 0) -> Array:
    """Products, or counts, of all classes of speed from `slowest` on."""
    total: Array = products[:, :, slowest:].sum(axis=2)
    return total
