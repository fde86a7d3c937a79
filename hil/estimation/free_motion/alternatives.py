"""What other laws of friction and dead zones would have found, had they been chosen.

A law that is chosen is not the truth. What it gets wrong repeats with the motion, and where the
motion repeats itself, as exciting trajectories do, neither blocks of time nor cells of states show
much of it. But another law gets something else wrong. So alternatives m are taken as draws: with
weights w_m, the root mean square error on held-out blocks of the choice over theirs, they add

    V = sum w_m (x_m - x)(x_m - x)' / sum w_m

to the covariance of what all laws have, as averaging over models would (J. A. Hoeting et al.,
Bayesian model averaging, Statistical Science 14 (1999) 382-417, eq. 3). An alternative that
predicts badly counts little. Dead zones smaller than the chosen one are no alternatives: slow
samples spoil what they find by more than chance, though they fit these samples best. Laws that
nobody would choose are among them, and some err more than the choice, so the share `SHARE` of V is
taken: over twins of seven robots, twelve seeds each, errors are 0.6 (seven axes) to 1.2 times
(portal) as large as is stated then.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.accumulation import SPEEDS
from hil.estimation.free_motion.friction_terms import COLUMNS
from hil.estimation.free_motion.system import summed
from hil.regression.choice import HeldOut
from hil.regression.normal_equations import normal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice

    Array = NDArray[np.float64]

SHARE = 0.6
"""Of the spread of alternatives that counts."""
OTHER_LAWS = ("cube root", "arc tangent", "all speeds and load", "all")
"""That hold most of what friction does with speed."""


def covariance_of_choices(products: Products, choice: Choice) -> Array:
    """Covariance from one choice to another, of base parameters, coupled motors and offsets.

    Returns
    -------
    ndarray, shape (n, n)
        Of all unknowns; 0 of the other terms of friction, which mean something else in each law.
    """
    zones = [replace(choice, slowest=k) for k in range(choice.slowest, len(SPEEDS))]
    laws = [replace(choice, laws=(law,) * products.n_joints) for law in OTHER_LAWS]
    x, error = _solved(products, choice)
    total, weights = np.zeros((len(x), len(x))), 1.0
    for other in (*zones, *laws):
        found, own = _solved(products, other)
        change = np.where(_common(products), found - x, 0.0)
        weight = min(1.0, np.sqrt(error / max(own, np.finfo(float).tiny)))
        total += weight * np.outer(change, change)
        weights += weight
    return SHARE * total / weights


def _solved(products: Products, choice: Choice) -> tuple[Array, float]:
    """Unknowns by a choice, and its squared error on held-out blocks at all speeds."""
    n_shared, kept = products.n_shared, choice.kept(products.n_shared)
    system = choice.equations(products)
    whole = normal(summed(products.pieces), n_shared, choice.weights)
    x = system.solution(kept)
    return x, float(HeldOut(system, whole).error(kept).sum())


def _common(products: Products) -> NDArray[np.bool_]:
    """Unknowns that all laws have."""
    own = np.array([term == "offset" for term in COLUMNS])
    return np.append(np.ones(products.n_shared, dtype=bool), np.tile(own, products.n_joints))
