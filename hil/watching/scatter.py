"""Scatter of torque means over short windows without contact, learned and tracked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.arrays import Array


SURE = 3.0
"""Allowance for the chance error in a mean of few squares, in standard deviations."""
MEMORY, ENOUGH = 120.0, 15.0
"""Averaging time of squares, and minimum time of motion for a valid mean [s]."""


def window_lengths(period: float, seconds: float = 0.1, shortest: int = 2) -> tuple[int, ...]:
    """Return window lengths, growing by about a third from window to window [samples].

    The longest takes `seconds`, the shortest `shortest` samples.
    """
    lengths, longest = [shortest], max(round(seconds / period), shortest)
    while lengths[-1] < longest:
        lengths.append(min(max(lengths[-1] + 1, round(1.35 * lengths[-1])), longest))
    return tuple(lengths)


class Scatter:
    """Mean squares of windows of several lengths, by axis.

    Parameters
    ----------
    lengths : ndarray of int, shape (n_windows,)
        Lengths of the windows [samples].
    n_joints : int
    period : float
        Time between two samples [s].
    memory, enough : float
        Averaging time of squares, and minimum time of motion for a valid mean [s].

    Attributes
    ----------
    squares : ndarray, shape (n_windows, n_joints)
        Mean squares.
    weights : ndarray, shape (n_joints,)
        Number of samples in the means, at most that of `memory`.
    """

    def __init__(
        self,
        lengths: NDArray[np.int_],
        n_joints: int,
        period: float,
        *,
        memory: float = MEMORY,
        enough: float = ENOUGH,
    ) -> None:
        self._lengths = lengths
        self.squares = np.zeros((len(lengths), n_joints))
        self.weights = np.zeros(n_joints)
        self._most, self._enough = memory / period, enough / period

    @property
    def rms(self) -> Array:
        """Root mean squares, shape (n_windows, n_joints); 0 before the first sample."""
        return np.sqrt(self.squares)

    @property
    def bound(self) -> Array:
        """Upper bound of the root mean squares, shape (n_windows, n_joints).

        After a short motion, a mean of n squares of non-overlapping windows may by chance be as
        small as (1 - 2 / 9n - `SURE` sqrt(2 / 9n))^3 times the true mean (Wilson and Hilferty,
        Proc. Natl. Acad. Sci. 17, 1931). If this factor is not positive, the bound is infinite.
        """
        ninths = 2 / 9 * self._lengths[:, np.newaxis] / np.maximum(self.weights, 1e-9)
        least = (1.0 - ninths - SURE * np.sqrt(ninths)).clip(0.0) ** 3
        rms = np.divide(self.rms, np.sqrt(least), out=np.full_like(least, np.inf), where=least > 0)
        return np.where(self.known, self.rms, rms)

    @property
    def known(self) -> NDArray[np.bool_]:
        """Mask of axes with enough motion, shape (n_joints,)."""
        return np.asarray(self.weights >= self._enough)

    def take(self, means: Array, used: NDArray[np.bool_]) -> None:
        """Update by the windows ending at some samples.

        Parameters
        ----------
        means : ndarray, shape (n, n_windows, n_joints)
        used : ndarray of bool, shape (n, n_joints)
        """
        number = used.sum(axis=0)
        self.weights = np.minimum(self.weights + number, self._most)
        mean = np.einsum("nwj,nj->wj", means**2, used) / np.maximum(number, 1)
        share = number / np.maximum(self.weights, 1.0)
        self.squares += share * (mean - self.squares)
