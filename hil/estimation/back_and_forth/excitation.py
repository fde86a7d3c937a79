"""Base parameters excited by motions of single axes, alone or in combination.

An axis moving alone shows the diagonal of the mass matrix, and gravity, but no couplings. Motion in
few configurations shows only sums of parameters. Linearly dependent columns of the regression are
found by Cholesky factorisation with pivoting of the scaled normal equations (Gautier, J. Robotic
Syst. 8 (1991) 485-506, does the same by the QR decomposition). Of a dependent set some parameters
are kept, and each represents itself and a share of the dropped ones:

    W_d = W_k B   so   W_k p_k + W_d p_d = W_k (p_k + B p_d).

Each step keeps the parameter with the longest remaining column, p35 in the sum p30 + 1.8e7 p35. If
p35 must be dropped for another reason, p30 is dropped too, since p30 would represent 1.8e7 p35: a
kept parameter represents at most `LARGEST` times another one.

A nearly dependent column is dropped too if noise alone would make the torque of its parameter, over
the recorded motion, uncertain by more than the share `LOOSE` of the torque: for rows of unit
residual variance and a column with the share r of its square length left, the sum of squares of
that torque is uncertain by 1 / r.

Dropped parameters are zero in the model: the model predicts only quantities excited by such
motions.
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
"""Largest coefficient of another parameter in the sum that a kept parameter represents. Longer
columns come first, so useful sums have coefficients up to about 1. On the UR10e the coefficients
are up to 2, but 1e5 or zero where axes are at right angles.
"""
NOTICEABLE = 1e-3
"""Smallest share of a parameter in a combination, below the displayed precision."""


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """Excited parameters and combinations.

    Attributes
    ----------
    kept : ndarray of int
        Identified parameters, alone or in combination.
    nuisance : ndarray of int
        Linearly independent nuisance unknowns, as indices into all unknowns.
    combination : ndarray, shape (n, n)
        ``combination @ p`` is the identified part of parameters p; rows of dropped parameters are
        zero.
    """

    kept: Indices
    nuisance: Indices
    combination: Array

    @property
    def unknowns(self) -> Indices:
        """Identified unknowns: parameters, then nuisances."""
        return np.concatenate([self.kept, self.nuisance])

    @property
    def lost(self) -> Indices:
        """Dropped parameters."""
        return np.setdiff1d(np.arange(len(self.combination)), self.kept)


def excitation(N: Array, n: int, square: float) -> Excitation:
    """Determine the excited parameters among the first `n` unknowns; the rest are nuisances.

    Parameters
    ----------
    N : ndarray, shape (n + k, n + k)
        Normal equations of rows with unit residual variance.
    square : float
        Sum of squared torques of these rows.
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
    # a parameter without any effect on the torque is in no combination
    parts = np.abs(shares) * length[kept, np.newaxis] > NOTICEABLE * length[lost]
    parts &= length[lost] > SILENT * length.max(initial=0.0)
    combination[np.ix_(kept, lost)] = np.where(parts, shares, 0.0)
    return Excitation(kept, nuisance, combination)


def independent(
    N: Array, size: Array, least: float = IDENTIFIABLE, largest: float = np.inf
) -> Indices:
    """Return the unknowns with linearly independent columns, in rising order.

    Parameters
    ----------
    N : ndarray, shape (n, n)
    size : ndarray, shape (n,)
        Squared lengths of the columns, the reference for the independent parts.
    least : float
        Smallest independent share of the squared length of a kept column.
    largest : float
        Largest coefficient of another unknown in a combination.
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
