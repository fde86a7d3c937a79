"""Normal equations of all unknowns, block by block, from inner products axis by axis.

Unknowns are those that all axes share, then each axis's friction with all terms that there are. A
law of friction is a choice among them, which costs no more than to leave rows and columns out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.friction_terms import BENT, COLUMNS
from hil.regression.least_squares import solved

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]

ROUNDS = 20
"""Times that residual variances and solution are found from each other, at most."""
ASIDE = 0.01
"""Share w of the samples under way that go in the other direction, below which an axis moves in one
direction only: there offset and Coulomb friction are at least sqrt(1 / w + 1) / 2 = 5 times as
uncertain as their sum."""


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """Shares of blocks in the normal equations N x = v.

    Attributes
    ----------
    N : ndarray, shape (n_blocks, n, n)
    v : ndarray, shape (n_blocks, n)
    square : ndarray, shape (n_blocks,)
        Weighted squares of the torque.
    """

    N: Array
    v: Array
    square: Array

    def only(self, kept: Indices) -> Normal:
        """The same with some unknowns alone; the others are zero."""
        return Normal(self.N[:, kept[:, None], kept], self.v[:, kept], self.square)

    def grouped(self, first: Indices) -> Normal:
        """Blocks added up to larger ones that begin at `first`."""
        N, v, square = (np.add.reduceat(x, first, axis=0) for x in (self.N, self.v, self.square))
        return Normal(N, v, square)

    def weighted(self, weights: Array) -> Normal:
        """Blocks with weights, shape (n_blocks,)."""
        return Normal(
            self.N * weights[:, None, None], self.v * weights[:, None], self.square * weights
        )

    def solution(self, kept: Indices | None = None) -> Array:
        """Least squares over all blocks; of `kept` unknowns alone, if given, the others zero."""
        if kept is not None:
            return embedded(self.only(kept).solution(), kept, self.v.shape[1])
        return solved(self.N.sum(axis=0), self.v.sum(axis=0))

    def error(self, x: Array) -> Array:
        """Weighted squares of what `x` leaves of each block, shape (n_blocks,)."""
        left: Array = self.square + (self.N @ x - 2.0 * self.v) @ x
        return np.maximum(left, 0.0)

    def scores(self, x: Array) -> Array:
        """What each block's own equations leave at `x`, shape (n_blocks, n)."""
        found: Array = self.v - self.N @ x
        return found


def axis_places(n_shared: int, n_joints: int, n_own: int) -> list[Indices]:
    """Where the columns of each axis, `n_own` of them its own, stand among all unknowns."""
    shared, own = np.arange(n_shared), np.arange(n_own)
    return [np.concatenate([shared, n_shared + axis * n_own + own]) for axis in range(n_joints)]


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


def normal(products: Array, n_shared: int, weights: Array) -> Normal:
    """Normal equations of all unknowns from inner products.

    Parameters
    ----------
    products : ndarray, shape (n_blocks, n_joints, m, m)
        The torque is column 0.
    weights : ndarray, shape (n_joints,)
        Of the axes' rows.
    """
    places = axis_places(n_shared, products.shape[1], products.shape[-1] - 1 - n_shared)
    n_blocks, n = len(products), int(places[-1][-1]) + 1
    N, v, square = np.zeros((n_blocks, n, n)), np.zeros((n_blocks, n)), np.zeros(n_blocks)
    for axis, (place, weight) in enumerate(zip(places, weights, strict=True)):
        N[np.ix_(np.arange(n_blocks), place, place)] += weight * products[:, axis, 1:, 1:]
        v[:, place] += weight * products[:, axis, 1:, 0]
        square += weight * products[:, axis, 0, 0]
    return Normal(N, v, square)


def mean_squares(products: Array, counts: Array, n_shared: int, x: Array) -> Array:
    """Mean square of what `x`, of all unknowns, leaves of each axis's torque, shape (n_joints,)."""
    places = axis_places(n_shared, products.shape[1], products.shape[-1] - 1 - n_shared)
    found = np.zeros(products.shape[1])
    for axis, place in enumerate(places):
        around = np.concatenate([[1.0], -x[place]])
        total = products[:, axis].sum(axis=0)
        found[axis] = max(float(around @ total @ around), 0.0) / max(counts[:, axis].sum(), 1.0)
    return found


def embedded(x: Array, kept: Indices, n: int) -> Array:
    """Kept unknowns among all `n`, the others zero."""
    found = np.zeros(n)
    found[kept] = x
    return found


def residual_weights(products: Array, counts: Array, n_shared: int, kept: Indices) -> Array:
    """Reciprocal residual variances of the axes, found by solving again and again."""
    squares = np.einsum("bjkk->jk", products)[:, 0]
    weights: Array = counts.sum(axis=0) / np.maximum(squares, 1e-12)
    totals = products.sum(axis=0, keepdims=True), counts.sum(axis=0, keepdims=True)
    for _ in range(ROUNDS):
        before, system = weights, normal(totals[0], n_shared, weights)
        x = system.solution(kept)
        left = mean_squares(*totals, n_shared, x)
        weights = 1.0 / np.maximum(left, 1e-9 * squares / np.maximum(counts.sum(axis=0), 1.0))
        weights = np.asarray(np.where(np.isfinite(weights), weights, 0.0))
        if np.allclose(before, weights, rtol=1e-6):
            break
    return weights


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
    """Products of all classes of speed from `slowest` on."""
    total: Array = products[:, :, slowest:].sum(axis=2)
    return total
