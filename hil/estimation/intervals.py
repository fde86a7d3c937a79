"""Compute half-widths of confidence intervals from two kinds of error.

Errors visible in the data have an estimated variance: Student's t with its effective degrees of
freedom. Errors of values in the robot file (torque constants, rotor inertias) have a known
variance: the normal distribution. The degrees of freedom of a combination of parameters, such as a
torque, follow from those of the parameters (Welch 1947, Satterthwaite 1946), weighted by each share
a_k^2 V_kk of the variance.

An estimate at the edge of its search range has no interval (`Edge`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from checked_files.yaml_file import FileModel

if TYPE_CHECKING:
    from hil.arrays import Array


SIGNIFICANT = 0.01
"""Significance level of a family of tests."""
MANY = 1e9
"""Degrees of freedom large enough for the normal distribution."""


class Edge(FileModel):
    """Estimate at the edge of its search range.

    Attributes
    ----------
    axis : int
        Axis from 1.
    what : str
        Name of the quantity.
    """

    axis: int
    what: str
    value: float
    bound: float
    unit: str


def half_width(scatter: Array, stated: Array, degrees: Array, level: float) -> Array:
    """Return half-widths at a confidence level, shape of the variances.

    Parameters
    ----------
    scatter, stated : ndarray
        Variances from the data, and variances of values in the robot file.
    degrees : ndarray
        Effective degrees of freedom of `scatter`.
    level : float
        Confidence level between 0 and 1.
    """
    tail = 0.5 + level / 2
    squares = special.stdtrit(degrees, tail) ** 2 * scatter + special.ndtri(tail) ** 2 * stated
    return np.sqrt(squares)


def welch_degrees(rows: Array, variances: Array, degrees: Array) -> Array:
    """Return Welch's and Satterthwaite's degrees of freedom of sums of independent values.

    Parameters
    ----------
    rows : ndarray, shape (..., n)
        Coefficients of each sum.
    variances, degrees : ndarray, shape (n,)
        Variances and degrees of freedom of the values.
    """
    shares = rows**2 * variances
    total, fourth = shares.sum(axis=-1) ** 2, (shares**2 / degrees).sum(axis=-1)
    found: Array = np.divide(total, fourth, out=np.full_like(total, MANY), where=fourth > 0)
    return found


def combined_degrees(rows: Array, variances: Array, degrees: Array) -> Array:
    """Return degrees of freedom of combinations of parameters, shape (...,).

    Arguments as of `welch_degrees`. The parameters share their groups of measurements, so a
    combination has no more degrees of freedom than the best of its parameters alone.
    """
    best = np.where(rows**2 * variances > 0, degrees, 0.0).max(axis=-1)
    found = welch_degrees(rows, variances, degrees)
    return np.where(best > 0, np.minimum(found, best), found)


def degrees_behind(ratio: float) -> float:
    """Return the degrees of freedom for a 95 % half-width of `ratio` standard errors."""
    from scipy import optimize  # noqa: PLC0415 - takes long to load, and half-widths need none

    def excess(degrees: float) -> float:
        return float(special.stdtrit(degrees, 0.975)) - ratio

    return float(optimize.brentq(excess, 1.0, MANY)) if excess(MANY) < 0 < excess(1.0) else MANY
