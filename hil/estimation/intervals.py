"""Half-widths of confidence intervals from two kinds of error.

What shows in the data has a variance that is itself estimated: Student's t with its effective
degrees of freedom. What the robot file states (torque constants, rotor inertias) has a known one:
the normal distribution. A combination of parameters, such as a torque, takes its degrees of freedom
from those of the parameters (Welch 1947, Satterthwaite 1946), each with its own share a_k^2 V_kk of
the variance.

An estimate that ends at the edge of its search range has no interval (`Edge`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from checked_files.yaml_file import FileModel

if TYPE_CHECKING:
    from hil.arrays import Array


SIGNIFICANT = 0.01
"""Probability with which chance may pass for an effect, of all that is tested together."""
MANY = 1e9
"""Degrees of freedom from which on Student's t is the normal distribution."""


class Edge(FileModel):
    """An estimate that ends at the edge of its search range.

    Attributes
    ----------
    axis : int
        From 1.
    what : str
        Name of the quantity.
    value, bound : float
    unit : str
    """

    axis: int
    what: str
    value: float
    bound: float
    unit: str


def half_width(scatter: Array, stated: Array, degrees: Array, level: float) -> Array:
    """Half-widths at a confidence level, shape of the variances.

    Parameters
    ----------
    scatter, stated : ndarray
        Variances that show in the data, and that the robot file states.
    degrees : ndarray
        Effective degrees of freedom of `scatter`.
    level : float
        Between 0 and 1.
    """
    tail = 0.5 + level / 2
    squares = special.stdtrit(degrees, tail) ** 2 * scatter + special.ndtri(tail) ** 2 * stated
    return np.sqrt(squares)


def combined_degrees(rows: Array, variances: Array, degrees: Array) -> Array:
    """Degrees of freedom of combinations of parameters, shape (...,).

    Parameters
    ----------
    rows : ndarray, shape (..., n_base)
        Coefficients of each combination.
    variances, degrees : ndarray, shape (n_base,)
        Of the parameters.
    """
    shares = rows**2 * variances
    total, fourth = shares.sum(axis=-1) ** 2, (shares**2 / degrees).sum(axis=-1)
    found: Array = np.divide(total, fourth, out=np.full_like(total, MANY), where=fourth > 0)
    return found


def degrees_behind(ratio: float) -> float:
    """Degrees of freedom with which a half-width of 95 % is `ratio` standard errors."""
    from scipy import optimize  # noqa: PLC0415 - takes long to load, and half-widths need none

    def excess(degrees: float) -> float:
        return float(special.stdtrit(degrees, 0.975)) - ratio

    return float(optimize.brentq(excess, 1.0, MANY)) if excess(MANY) < 0 < excess(1.0) else MANY
