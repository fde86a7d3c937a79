"""Which base parameters such motions show, and which only together with others.

An axis that moves by itself shows what is on the diagonal of the mass matrix, and gravity; it never
shows couplings, and from few configurations sums of parameters only. Columns of the regression that
are combinations of others are found by Cholesky's factorisation with pivoting of the scaled normal
equations (Gautier, J. Robotic Syst. 8 (1991) 485-506, does the same by the QR decomposition). Of
such a set some parameters are kept, and each stands for itself and a share of those that are not:

    W_d = W_k B   so   W_k p_k + W_d p_d = W_k (p_k + B p_d).

Kept is, time and again, the parameter whose column is the longest of those that are left: of
p30 + 1.8e7 p35, p35 is the one that shows. Where p35 itself is not to be kept, p30 is not either,
since it would stand for p35 all the same: for no more than `LARGEST` of another parameter.

A column that is nearly such a combination is one too, where noise alone would make its parameter's
torque, over the recorded motion, uncertain by more than the share `LOOSE` of the torque: with rows
of unit residual variance, of which it leaves the share r of its square length, that torque's sum of
squares is uncertain by 1 / r.

Those that are not kept are zero in the model: it predicts what such motions show, no more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.result import LOOSE
from hil.least_squares.solving import IDENTIFIABLE, SILENT, solved

if TYPE_CHECKING:
    from hil.arrays import Array, Indices

LARGEST = 10.0
"""Coefficient of another parameter in the sum that a parameter stands for, at most. Those of
parameters that could be kept themselves are 1 or less, since longer columns come first; UR10e has
1e5 or nothing else where its axes stand at right angles, and up to 2 elsewhere."""
NOTICEABLE = 1e-3
"""Share of a parameter in a combination below which it is none of its parts: less than is shown."""


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """What is excited.

    Attributes
    ----------
    kept : ndarray of int
        Parameters that are identified, by themselves or with others.
    nuisance : ndarray of int
        Nuisance that is independent of each other, among all unknowns.
    combination : ndarray, shape (n, n)
        ``combination @ p`` is what is identified of parameters p; rows of those that are not kept
        are zero.
    """

    kept: Indices
    nuisance: Indices
    combination: Array

    @property
    def unknowns(self) -> Indices:
        """All that are found: parameters, then nuisance."""
        return np.concatenate([self.kept, self.nuisance])

    @property
    def lost(self) -> Indices:
        """Parameters that are not kept."""
        return np.setdiff1d(np.arange(len(self.combination)), self.kept)


def excitation(N: Array, n: int, square: float) -> Excitation:
    """Which of the first `n` unknowns the normal equations determine; the others are nuisance.

    Parameters
    ----------
    N : ndarray, shape (n + k, n + k)
        Of rows with residuals of unit variance.
    square : float
        Sum of the squares of these rows' torques.
    """
    size = np.diag(N)
    nuisance = n + independent(N[n:, n:], size[n:])
    within = N[:n, nuisance] @ solved(N[np.ix_(nuisance, nuisance)], N[nuisance, :n])
    left = N[:n, :n] - within
    kept = independent(left, size[:n], max(IDENTIFIABLE, 1.0 / (LOOSE**2 * square)), LARGEST)
    lost = np.setdiff1d(np.arange(n), kept)
    combination = np.zeros((n, n))
    combination[kept, kept] = 1.0
    shares = solved(left[np.ix_(kept, kept)], left[np.ix_(kept, lost)])
    length = np.sqrt(size)
    # a parameter without any effect on the torque is no part of what the others stand for
    parts = np.abs(shares) * length[kept, np.newaxis] > NOTICEABLE * length[lost]
    parts &= length[lost] > SILENT * length.max(initial=0.0)
    combination[np.ix_(kept, lost)] = np.where(parts, shares, 0.0)
    return Excitation(kept, nuisance, combination)


def independent(
    N: Array, size: Array, least: float = IDENTIFIABLE, largest: float = np.inf
) -> Indices:
    """Unknowns whose columns are no combinations of those before, in rising order.

    Parameters
    ----------
    N : ndarray, shape (n, n)
    size : ndarray, shape (n,)
        Squares of the columns' lengths, with which what is left of them is compared.
    least : float
        Share of it that is left at least of an independent one.
    largest : float
        Coefficient with which an independent one may stand for another unknown.
    """
    heard = size > SILENT**2 * size.max(initial=0.0)
    scale = np.where(heard, 1.0, 0.0) / np.sqrt(np.where(heard, size, 1.0))
    left, kept = N * np.outer(scale, scale), []
    length, open_ = np.sqrt(size) * heard, heard.copy()
    for _ in range(len(N)):
        share = np.where(open_, np.diag(left), 0.0)
        pivot = int(np.argmax(np.where(share > least, share * size, 0.0)))
        if share[pivot] <= least:
            break
        open_[pivot] = False
        coefficients = left[:, pivot] / left[pivot, pivot] * length / length[pivot]
        if np.abs(coefficients).max() > largest:
            continue
        kept.append(pivot)
        column = left[:, pivot] / np.sqrt(left[pivot, pivot])
        left = left - np.outer(column, column)
        left[pivot], left[:, pivot] = 0.0, 0.0
    return np.array(sorted(kept), dtype=np.intp)
