"""Normal equations by group, computed from blocks (`Blocks.normal`).

    N x = v,    N = sum_j w_j W_j'W_j,    v = sum_j w_j W_j'y_j.

Groups are summed, and the squared residual of a group is ``y'y - 2 v'x + x'N x``. With instruments
Z in place of the left columns N is not symmetric.

Low-pass of the improved method at selected samples, for several columns at once.

Few of the samples are used, since the window makes samples closer than its width redundant. Means
are computed only there, by multiplication with a sparse matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from scipy import sparse

from hil.least_squares.layout import embedded
from hil.least_squares.solving import solved
from hil.least_squares.window import weights

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from hil.arrays import Array, Indices

Number = TypeVar("Number", np.float64, np.complex128)


def smooth_at(
    index: NDArray[np.intp], x: NDArray[Number], period: float, passes: int = 1
) -> NDArray[Number]:
    """Compute weighted means over the window at the samples `index` of `x`.

    Parameters
    ----------
    index : ndarray, shape (n,)
        Indices more than `passes` half windows away from both ends.
    x : ndarray, shape (n_samples, k)
        Samples every `period` [s].
    passes : int
        Number of passes of the window.

    Returns
    -------
    means : ndarray, shape (n, k)
    """
    flat = np.ascontiguousarray(x).view(np.float64)  # complex columns count as two each
    return np.asarray(window_means(index, len(x), period, passes) @ flat).view(x.dtype)


def window_means(
    index: NDArray[np.intp], n_samples: int, period: float, passes: int = 1
) -> sparse.csr_array:
    """Return the matrix of `smooth_at`, shape (n, n_samples)."""
    window = reduce(np.convolve, [weights(period)] * passes)
    first = index[:, np.newaxis] - len(window) // 2
    places = (first + np.arange(len(window))).ravel()
    rows = len(window) * np.arange(len(index) + 1)
    return sparse.csr_array(
        (np.tile(window, len(index)), places, rows), shape=(len(index), n_samples)
    )


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
