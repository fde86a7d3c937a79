"""Normal equations of all unknowns, block by block, from inner products axis by axis.

A block is what is left out, held out or clustered together: a measurement, a period, a piece of
time, a cell of states. Of its samples of axis j, with torque y and columns W, all that least
squares needs is the product

    P_j = [y W]'[y W],

whose parts are placed among all unknowns (`layout`) and added up over the axes, each weighted with
w_j, the reciprocal of its residual variance:

    N x = v,    N = sum_j w_j W_j'W_j,    v = sum_j w_j W_j'y_j.

Blocks add up too, and what x leaves of one is ``y'y - 2 v'x + x'N x``. With instruments Z in place
of the left columns, P_j = [y Z]'[y W] and N is not symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.layout import axis_place, embedded
from hil.least_squares.solving import solved

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array

    Indices = NDArray[np.intp]


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

    @classmethod
    def split(cls, products: Array) -> Normal:
        """Equations from inner products of torque and columns, shape (n_blocks, 1 + n, 1 + n)."""
        return cls(products[:, 1:, 1:], products[:, 1:, 0], products[:, 0, 0])

    @property
    def information(self) -> Array:
        """N of all blocks together, shape (n, n)."""
        total: Array = self.N.sum(axis=0)
        return total

    @property
    def vector(self) -> Array:
        """Right-hand side of all blocks together, shape (n,)."""
        total: Array = self.v.sum(axis=0)
        return total

    def only(self, kept: Indices) -> Normal:
        """The same with some unknowns alone, in rising order; the others are zero."""
        if len(kept) == self.v.shape[1]:
            return self
        return Normal(self.N[:, kept[:, None], kept], self.v[:, kept], self.square)

    def grouped(self, most: int) -> Normal:
        """Successive blocks added up to `most` larger ones, if there are more."""
        first = [part.start for part in successive(0, len(self.v), min(most, len(self.v)))]
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
        return solved(self.information, self.vector)

    def error(self, x: Array) -> Array:
        """Weighted squares of what `x` leaves of each block, shape (n_blocks,)."""
        left: Array = self.square + (self.N @ x - 2.0 * self.v) @ x
        return np.maximum(left, 0.0)

    def scores(self, x: Array) -> Array:
        """What each block's own equations leave at `x`, shape (n_blocks, n)."""
        found: Array = self.v - self.N @ x
        return found


def normal(products: Array, n_shared: int, weights: Array) -> Normal:
    """Normal equations of all unknowns from inner products of each axis.

    Parameters
    ----------
    products : ndarray, shape (n_blocks, n_joints, 1 + m, 1 + m)
        The torque is column 0, the `n_shared` columns that all axes share come next.
    weights : ndarray, shape (n_joints,)
        Of the axes' rows.
    """
    n_blocks, n_joints = products.shape[:2]
    n_own = products.shape[-1] - 1 - n_shared
    n = n_shared + n_joints * n_own
    N, v, square = np.zeros((n_blocks, n, n)), np.zeros((n_blocks, n)), np.zeros(n_blocks)
    for axis, weight in enumerate(weights):
        place, own = axis_place(n_shared, n_own, axis), Normal.split(products[:, axis])
        N[:, place[:, None], place] += weight * own.N
        v[:, place] += weight * own.v
        square += weight * own.square
    return Normal(N, v, square)


def mean_squares(products: Sequence[Array], counts: Array, n_shared: int, x: Array) -> Array:
    """Mean square of what `x`, of all unknowns, leaves of each axis's torque, shape (n_joints,).

    Parameters
    ----------
    products : sequence (n_joints,) of ndarray, shape (1 + m, 1 + m)
        Of all blocks together, columns as of `normal`.
    counts : ndarray, shape (n_joints,)
        Samples behind them.
    """
    squares = np.zeros(len(products))
    for axis, product in enumerate(products):
        place = axis_place(n_shared, len(product) - 1 - n_shared, axis)
        around = np.concatenate([[1.0], -x[place]])
        squares[axis] = max(float(around @ product @ around), 0.0)
    found: Array = squares / np.maximum(counts, 1.0)
    return found


def reweighted(
    weigh: Callable[[Array], Array],
    first: Array,
    rounds: int = 20,
    tolerance: float | None = 1e-6,
) -> Array:
    """Weights of rows, or their variances, and solution found from each other again and again.

    Parameters
    ----------
    weigh : callable
        Solves with given weights, and makes others of what the solution leaves.
    first : ndarray
        Weights to begin with.
    rounds : int
        At most.
    tolerance : float, optional
        Relative change at which that ends before.
    """
    weights = first
    for _ in range(rounds):
        before, weights = weights, weigh(weights)
        if tolerance is not None and np.allclose(before, weights, rtol=tolerance, atol=0.0):
            break
    return weights


def successive(first: int, stop: int, n: int) -> list[slice]:
    """Cut what stands from `first` to `stop` into `n` successive parts of about equal length."""
    ends = np.linspace(first, stop, n + 1).round().astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]
