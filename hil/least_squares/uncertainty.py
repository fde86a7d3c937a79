"""Uncertainty of a least-squares solution from the scatter between measurements.

Unknowns x solve ``N x = v``; measurement k contributes S_k to N and s_k to v. Its *score* is the
residual of its own normal equations at the solution of all, ``s_k - S_k x``.

sandwich
    To first order the solution changes by N^-1 times the right-hand side's error. So with the
    covariance M of that error (the meat), the covariance of x is N^-1 M N^-1. The scores estimate
    M = sum of score score' (Huber, Proc. 5th Berkeley Symp. 1 (1967) 221-233), for any noise within
    a measurement; for white noise of variance s^2, M = s^2 N and s^2 N^-1 remains.
jackknife
    The exact change of the solution without a measurement,
    ``x_(k) - x = -(N - S_k)^-1 (s_k - S_k x)``, needs no linearisation: the covariance is
    (n - 1) / n times the sum of the squared changes (Efron and Tibshirani, *An Introduction to
    the Bootstrap*, 1993, chapter 11). It includes all differences between measurements, but is
    too large for few influential measurements: the solution without one of them is worse than
    the solution itself.
bias-reduced
    The fit makes scores too small. Each is divided by the root of the share of its variance that
    remains for white noise, for which the result is unbiased (CR2 of Bell and McCaffrey, Survey
    Methodology 28 (2002) 169-181). For white noise and B of ``B'N B = 1`` measurement k has the
    share ``H = B'S_k B`` of the solution, and changes it by ``B (1 - H)^(-1/2) B'(s_k - S_k x)``;
    in place of (1 - H)^(-1/2) the jackknife has (1 - H)^-1 and the sandwich 1.

The accuracy of a covariance from scatter depends on the number of measurements that carry an
unknown. A variance to which measurement k contributes the share v_k has the effective degrees of
freedom ``(sum v)^2 / sum v^2 - 1`` (Satterthwaite, Biometrics Bull. 2 (1946) 110-114).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.least_squares.solving import inverse, inverse_root, solved, undetermined

if TYPE_CHECKING:
    from hil.arrays import Array


TWICE = 1.96
"""Half-width of a 95 % interval in standard errors, for a known variance."""
OUTSIDE = 2.0 * special.ndtr(-TWICE)
"""Share of samples outside correct 95 % intervals."""
UNCERTAIN = 0.5
"""Ratio of standard error to value above which a parameter may count as not identifiable: the 95 %
interval contains zero."""
FEWEST = 2.0
"""Minimum degrees of freedom: for fewer, Student's t gives useless intervals."""
ALMOST_NONE = 1.0
"""Minimum degrees of freedom for a variance carried by a single measurement, which is almost no
evidence."""
_ALONE = 1e-6
"""Floor of 1 - H, for directions determined by a single measurement."""


class Solved(NamedTuple):
    """Solution with uncertainty from the differences between measurements.

    Attributes
    ----------
    x : ndarray, shape (n,)
    covariance : ndarray, shape (n, n)
    degrees_of_freedom : ndarray, shape (n,)
    """

    x: Array
    covariance: Array
    degrees_of_freedom: Array


def scatter(scores: Array, *, few: bool = False) -> Array:
    """Compute the covariance of the normal equations' right-hand side from measurements' scores.

    Parameters
    ----------
    scores : ndarray, shape (n_measurements, n)
    few : bool
        Subtract the scores' mean and correct by n / (n - 1), which matters for few measurements, or
        if the sum of the scores is not zero.

    Returns
    -------
    meat : ndarray, shape (n, n)
    """
    n = len(scores)
    spread = scores - scores.mean(axis=0) if few else scores
    return spread.T @ spread * (n / max(n - 1, 1) if few else 1.0)


def sandwich(inverse: Array, meat: Array) -> Array:
    """Compute the covariance of x, shape (n, n), from N^-1 and the right-hand side's covariance."""
    return inverse @ meat @ inverse.T


def classical(J: Array, variance: float) -> Array:
    """Compute the covariance of x for white residuals; inf on the diagonal if undetermined.

    Parameters
    ----------
    J : ndarray, shape (m, n)
        Change of the residuals per change of x.
    variance : float
        Variance of the residuals.
    """
    N = J.T @ J
    covariance = variance * inverse(N)
    np.fill_diagonal(covariance, np.where(undetermined(N), np.inf, np.diag(covariance)))
    return covariance


def jackknife(changes: Array) -> Array:
    """Compute the jackknife covariance of x, shape (n, n).

    Parameters
    ----------
    changes : ndarray, shape (n_measurements, n)
        Changes of x by leaving out one measurement at a time.
    """
    n = len(changes)
    return (n - 1) / n * (changes.T @ changes)


def leave_out(shares: Array, scores: Array) -> Array:
    """Compute changes of x by leaving out one measurement at a time, shape (n_measurements, n).

    Parameters
    ----------
    shares : ndarray, shape (n_measurements, n, n)
    scores : ndarray, shape (n_measurements, n)
        Scores at the joint solution.
    """
    N = shares.sum(axis=0)
    return np.array([solved(N - S, -score) for S, score in zip(shares, scores, strict=True)])


def effective_degrees(shares: Array, fewest: float = FEWEST) -> Array:
    """Compute effective degrees of freedom of variances with the measurements' `shares`.

    Parameters
    ----------
    shares : ndarray, shape (n_measurements, n)
        Shares of the measurements, not negative.
    fewest : float
        Minimum result; the maximum is ``n_measurements - 1``, if larger.

    Returns
    -------
    degrees : ndarray, shape (n,)
    """
    squares = np.maximum((shares**2).sum(axis=0), np.finfo(float).tiny)
    degrees: Array = shares.sum(axis=0) ** 2 / squares - 1.0
    return np.clip(degrees, fewest, max(len(shares) - 1.0, fewest))


def degrees_if_white(inverse: Array, shares: Array, fewest: float = FEWEST) -> Array:
    """Compute effective degrees of freedom from the shares of measurements in white noise.

    After Bell and McCaffrey, Survey Methodology 28 (2002) 169-181. Shares from the residuals are as
    uncertain as the variance itself: with these, an unknown of 14 standard errors was not
    significant.

    Parameters
    ----------
    inverse : ndarray, shape (n, n)
        Inverse of N.
    shares : ndarray, shape (n_measurements, n, n)
    fewest : float
        As in `effective_degrees`.
    """
    return effective_degrees(((inverse @ shares) * inverse.T).sum(axis=-1), fewest)


def leave_one_out(shares: Array, sides: Array) -> Solved:
    """Solve normal equations, and compute the jackknife covariance by measurement.

    Degrees of freedom are those of `degrees_if_white`.

    Parameters
    ----------
    shares : ndarray, shape (n_measurements, n, n)
    sides : ndarray, shape (n_measurements, n)
    """
    N = shares.sum(axis=0)
    x = solved(N, sides.sum(axis=0))
    changes = leave_out(shares, sides - shares @ x)
    degrees = degrees_if_white(solved(N, np.eye(len(N))), shares, ALMOST_NONE)
    return Solved(x, jackknife(changes), degrees)


def bias_reduced(shares: Array, sides: Array) -> Solved:
    """Solve normal equations with nearly white noise of variance 1.

    No variance is less than for white noise of variance 1, since a direction determined by a single
    measurement leaves no score. Degrees of freedom are those of `degrees_if_white`.

    Parameters
    ----------
    shares : ndarray, shape (n_measurements, n, n)
    sides : ndarray, shape (n_measurements, n)
    """
    N = shares.sum(axis=0)
    B = inverse_root(N)
    x = B @ (B.T @ sides.sum(axis=0))
    changes = corrected(B, shares, sides - shares @ x)
    covariance, white = changes.T @ changes, np.einsum("ij,ij->i", B, B)
    covariance += np.diag(np.maximum(white - np.diag(covariance), 0.0))
    return Solved(x, covariance, degrees_if_white(B @ B.T, shares, ALMOST_NONE))


def corrected(B: Array, shares: Array, scores: Array) -> Array:
    """Compute changes of x by single measurements, unbiased for white noise.

    Parameters
    ----------
    B : ndarray, shape (n, n)
        Inverse root of the information of all measurements.
    shares : ndarray, shape (n_measurements, n, n)
    scores : ndarray, shape (n_measurements, n)

    Returns
    -------
    ndarray, shape (n_measurements, n)
    """
    H, V = np.linalg.eigh(B.T @ shares @ B)
    left = np.sqrt(np.clip(1.0 - H, _ALONE, 1.0))
    turned = np.einsum("kji,kj->ki", V, scores @ B) / left
    found: Array = np.einsum("kij,kj->ki", V, turned) @ B.T
    return found


def correlation_of(covariance: Array) -> Array:
    """Compute correlations, shape (n, n); zero for unknowns with zero or infinite variance."""
    variance = np.diag(covariance)
    finite = np.isfinite(variance) & (variance > 0)
    scale = np.where(finite, 1.0, 0.0) / np.sqrt(np.where(finite, variance, 1.0))
    return np.where(np.isfinite(covariance), covariance, 0.0) * np.outer(scale, scale)


def shrunk(change: Array, root: Array, square: float) -> Array:
    """Return the likeliest change by an omitted column, shape (n,).

    In combinations of unknowns that are hardly excited, two solutions differ by any amount. A
    column c moves the unknown of a column z by |c| / |z| at most, unless other columns resemble z.
    With these bounds as standard deviations of a prior of covariance P, and the covariance V of the
    solution, the change d becomes P (P + V)^-1 d. Combinations with errors far below the bounds
    keep the whole change.

    Parameters
    ----------
    change : ndarray, shape (n,)
        Difference of the solutions with and without the column.
    root : ndarray, shape (m, k)
        Root C of the covariance C C' of all m >= n unknowns, for equations of unit variance.
    square : float
        Sum of squares of the column times its unknown.
    """
    n = len(change)
    lengths = (np.linalg.pinv(root)[:, :n] ** 2).sum(axis=0)
    P = np.diag(square / np.where(lengths > 0, lengths, np.inf))
    V = root[:n] @ root[:n].T
    scale = np.sqrt(np.maximum(np.diag(P + V), np.finfo(float).tiny))
    weighed = solved((P + V) / np.outer(scale, scale), change / scale)
    return np.asarray(P @ (weighed / scale))
