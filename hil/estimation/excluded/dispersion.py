"""Dispersion of scores between groups, moderated over causes, for the tests of `battery`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.least_squares.uncertainty import effective_degrees

if TYPE_CHECKING:
    from hil.arrays import Array

ALIKE = 1e-6
"""Share of the largest eigenvalue below which columns of a cause are linearly dependent."""
LEVERAGE = 1e-3
"""Lower limit of the share of a group's variance that the fit leaves."""


class Common(NamedTuple):
    """Common dispersion of several causes, and the degrees of freedom."""

    dispersion: float
    degrees: float


def moderated(phi: Array, degrees: Array, correlation: Array) -> Common:
    """Return common dispersion and degrees of freedom, after Smyth (2004), section 6.2.

    In that paper, thousands of dispersions scatter independently about the common dispersion. Here
    some tens are correlated: they scatter less than their uncertainty suggests, and the common
    dispersion is uncertain, too.

    Parameters
    ----------
    correlation : ndarray, shape (n_columns, n_columns)
        Correlations of the dispersions.
    """
    half = degrees / 2
    e = np.log(np.maximum(phi, np.finfo(float).tiny)) - special.digamma(half) + np.log(half)
    error = np.sqrt(special.polygamma(1, half))
    covariance = np.outer(error, error) * correlation
    shared = float(covariance.mean())
    beyond = float(np.var(e)) - (float(np.diag(covariance).mean()) - shared)
    # solve trigamma(x) = y by Newton's method (Smyth 2004, appendix)
    y = shared + max(beyond, 0.0)
    x = 0.5 + 1.0 / y
    for _ in range(20):  # the iteration converges from below in a few steps
        value = float(special.polygamma(1, x))
        x += value * (1.0 - value / y) / float(special.polygamma(2, x))
    d = 2.0 * x
    return Common(float(np.exp(e.mean() + special.digamma(d / 2) - np.log(d / 2))), d)


def dispersion(left: Array, shares: Array, information: Array) -> tuple[Array, Array]:
    """Return the variance of summed scores over that of white noise, and degrees of freedom.

    Parameters
    ----------
    left : ndarray, shape (n_groups, n_columns)
        Scores less the contribution of the common size of all groups.
    """
    h = shares / np.maximum(information, np.finfo(float).tiny)
    phi = (left**2 / np.maximum(1.0 - h, LEVERAGE) ** 2).sum(axis=0) / information
    return phi, effective_degrees(h, fewest=0.0)


def orthonormal(products: Array) -> Array:
    """Return combinations that make columns orthonormal, shape (n, rank), from inner products."""
    if not len(products):
        return products
    length = np.sqrt(np.diag(products))
    values, vectors = np.linalg.eigh(products / np.outer(length, length))
    kept = values > ALIKE * values.max()
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]) / length[:, None])


def freedom(products: Array) -> float:
    """Return degrees of freedom of a mean square of normal variables with correlated columns."""
    length = np.sqrt(np.diag(products))
    correlation = products / np.outer(length, length)
    np.fill_diagonal(correlation, 1.0)  # without rounding: one column has exactly one degree
    return float(len(products) ** 2 / np.sum(correlation**2))


def enlargement(Q: Array) -> tuple[Array, Array]:
    """Return V and f with (1 - QQ')^(-1/2) = 1 + V diag(f) V', from the smaller of QQ' and Q'Q."""
    wide = len(Q) < Q.shape[1]
    values, vectors = np.linalg.eigh(Q @ Q.T if wide else Q.T @ Q)
    factor = 1.0 / np.sqrt(np.clip(1.0 - values, LEVERAGE, 1.0)) - 1.0
    if not wide:
        vectors, factor = Q @ vectors, factor / np.maximum(values, np.finfo(float).eps)
    return vectors, factor
