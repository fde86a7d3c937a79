"""Normal equations by group, computed from blocks (`Blocks.normal`).

    N x = v,    N = sum_j w_j W_j'W_j,    v = sum_j w_j W_j'y_j.

Groups are summed, and the squared residual of a group is ``y'y - 2 v'x + x'N x``. With instruments
Z in place of the left columns N is not symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.layout import embedded
from hil.least_squares.solving import solved

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.arrays import Array, Indices


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """Contributions of blocks to the normal equations N x = v.

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
        """Split inner products (n_blocks, 1 + n, 1 + n) of torque and columns into equations."""
        return cls(products[:, 1:, 1:], products[:, 1:, 0], products[:, 0, 0])

    @property
    def information(self) -> Array:
        """N summed over blocks, shape (n, n)."""
        total: Array = self.N.sum(axis=0)
        return total

    @property
    def vector(self) -> Array:
        """Right-hand side summed over blocks, shape (n,)."""
        total: Array = self.v.sum(axis=0)
        return total

    def only(self, kept: Indices) -> Normal:
        """Select unknowns; the rest are zero."""
        return Normal(self.N[:, kept[:, None], kept], self.v[:, kept], self.square)

    def grouped(self, most: int) -> Normal:
        """Sum successive blocks into at most `most` larger blocks."""
        first = [part.start for part in successive(0, len(self.v), min(most, len(self.v)))]
        N, v, square = (np.add.reduceat(x, first, axis=0) for x in (self.N, self.v, self.square))
        return Normal(N, v, square)

    def weighted(self, weights: Array) -> Normal:
        """Weight the blocks, shape (n_blocks,)."""
        return Normal(
            self.N * weights[:, None, None], self.v * weights[:, None], self.square * weights
        )

    def solution(self, kept: Indices | None = None) -> Array:
        """Solve by least squares over the blocks, for `kept` unknowns (zero elsewhere) if given."""
        if kept is not None:
            return embedded(self.only(kept).solution(), kept, self.v.shape[1])
        return solved(self.information, self.vector)

    def error(self, x: Array) -> Array:
        """Compute the weighted squared residual of `x` per block, shape (n_blocks,)."""
        left: Array = self.square + (self.N @ x - 2.0 * self.v) @ x
        return np.maximum(left, 0.0)

    def scores(self, x: Array) -> Array:
        """Compute the residual of every block's own equations at `x`, shape (n_blocks, n)."""
        return self.v - self.N @ x


def reweighted(weigh: Callable[[Array], Array], first: Array, rounds: int = 20) -> Array:
    """Iterate weights of rows (or variances) and solution until convergence.

    Parameters
    ----------
    weigh : callable
        Function that solves with given weights, and returns new weights from the residual.
    first : ndarray
        Initial weights.
    rounds : int
        Maximum number of iterations.
    """
    weights = first
    for _ in range(rounds):
        before, weights = weights, weigh(weights)
        # convergence tolerance
        if np.allclose(before, weights, rtol=1e-6, atol=0.0):
            break
    return weights


def successive(first: int, stop: int, n: int) -> list[slice]:
    """Split the range from `first` to `stop` into `n` successive parts of about equal length."""
    ends = np.linspace(first, stop, n + 1).round().astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]
