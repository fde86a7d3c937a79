"""What the data choose: the law of friction of each axis, and the dead zone at low speed.

Alternatives are compared by the error of prediction on blocks that were held out, in turn, and so
block by block: the difference of two alternatives' squared errors has a mean and a standard error
over blocks. An alternative is worse than the best if that mean is positive by more than `CHANCE`
standard errors. Chosen is the simplest that is not worse, unless one that is simpler still predicts
as well: a richer law is never chosen that predicts held-out blocks worse than a simpler one.

Dead zones are compared on fast samples alone, the same for all: a fit that slow samples have
spoilt, where friction depends on the way since the last reversal, predicts fast ones worse. On all
samples it would always be the fit on all samples that seems best.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.friction_terms import LAWS
from hil.estimation.free_motion.system import (
    embedded,
    kept_unknowns,
    normal,
    residual_weights,
    summed,
)
from hil.regression.least_squares import solved

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.system import Normal

    Array = NDArray[np.float64]

FOLDS = 12
"""Parts of the pieces that are held out in turn."""
CHANCE = 2.0
"""Standard errors up to which a difference is taken for chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """What was chosen, and the errors that decided.

    Attributes
    ----------
    slowest : int
        First class of speed that is fitted: 0 where there is no dead zone.
    laws : tuple of str
        Of each axis, by name.
    held_out : tuple of dict
        Of each axis: root mean square of the held-out error by law, over that of the law chosen.
    weights : ndarray, shape (n_joints,)
        Of the axes' rows.
    """

    slowest: int
    laws: tuple[str, ...]
    held_out: tuple[dict[str, float], ...]
    weights: Array

    def kept(self, n_shared: int) -> NDArray[np.intp]:
        """Unknowns that the laws leave."""
        return kept_unknowns(n_shared, [LAWS[law] for law in self.laws])


def choose(products: Products) -> Choice:
    """Choose dead zone, then laws axis by axis."""
    kept = _kept(products, ["all"] * products.n_joints)
    pieces, counts = summed(products.pieces), products.counts.sum(axis=2)
    weights = residual_weights(pieces, counts, products.n_shared, kept)
    slowest = _dead_zone(products, weights)
    pieces, counts = summed(products.pieces, slowest), products.counts[:, :, slowest:].sum(axis=2)
    weights = residual_weights(pieces, counts, products.n_shared, kept)
    system = normal(pieces, products.n_shared, weights)
    whole = normal(summed(products.pieces), products.n_shared, weights)
    held_out = HeldOut(system, whole)
    laws, errors = ["all"] * products.n_joints, []
    for axis in range(products.n_joints):
        found = {
            law: held_out.error(_kept(products, (*laws[:axis], law, *laws[axis + 1 :])))
            for law in LAWS
        }
        laws[axis] = simplest(found)
        errors.append(_relative(found, laws[axis]))
    return Choice(slowest, tuple(laws), tuple(errors), weights)


def without_choice(products: Products, *, weighted: bool) -> Choice:
    """Coulomb's and viscous friction at all speeds; rows alike, or by residual variance."""
    n, law = products.n_joints, "Coulomb and viscous"
    weights = np.ones(n)
    if weighted:
        kept = _kept(products, [law] * n)
        counts = products.counts.sum(axis=2)
        weights = residual_weights(summed(products.pieces), counts, products.n_shared, kept)
    return Choice(0, (law,) * n, ({},) * n, weights)


def simplest(errors: Mapping[str, Array]) -> str:
    """Name of the first alternative that is not worse than the best.

    Parameters
    ----------
    errors : mapping of name to ndarray, shape (n_blocks,)
        Squared errors on held-out blocks, the simplest alternative first.
    """
    best = min(errors, key=lambda name: float(errors[name].sum()))
    found = next(name for name in errors if not _worse(errors[name] - errors[best]))
    return next(name for name in errors if errors[name].sum() <= errors[found].sum())


class HeldOut:
    """Errors of prediction on blocks that a fit did not see.

    Parameters
    ----------
    fitted : Normal
        Equations that are solved.
    scored : Normal
        Equations of the samples that count, of the same blocks.
    """

    def __init__(self, fitted: Normal, scored: Normal) -> None:
        self._scored = scored
        self._folds = folds(len(fitted.v))
        N, v = fitted.N.sum(axis=0), fitted.v.sum(axis=0)
        self._N = [N - fitted.N[fold].sum(axis=0) for fold in self._folds]
        self._v = [v - fitted.v[fold].sum(axis=0) for fold in self._folds]

    def error(self, kept: NDArray[np.intp]) -> Array:
        """Squared error of each block by a fit of some unknowns to the other folds' blocks."""
        found = np.zeros(len(self._scored.v))
        for fold, N, v in zip(self._folds, self._N, self._v, strict=True):
            x = embedded(solved(N[np.ix_(kept, kept)], v[kept]), kept, len(v))
            left = (self._scored.N[fold] @ x - 2.0 * self._scored.v[fold]) @ x
            found[fold] = self._scored.square[fold] + left
        return np.maximum(found, 0.0)


def folds(n: int) -> list[slice]:
    """Successive blocks that are held out together."""
    ends = np.linspace(0, n, min(FOLDS, n) + 1).round().astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def _dead_zone(products: Products, weights: Array) -> int:
    fast = products.pieces.shape[2] - 1
    kept = _kept(products, ["all"] * products.n_joints)
    scored = normal(summed(products.pieces, fast), products.n_shared, weights)
    errors = {
        str(slowest): HeldOut(
            normal(summed(products.pieces, slowest), products.n_shared, weights), scored
        ).error(kept)
        for slowest in range(fast)
    }
    return int(simplest(errors))


def _kept(products: Products, laws: Sequence[str]) -> NDArray[np.intp]:
    return kept_unknowns(products.n_shared, [LAWS[law] for law in laws])


def _worse(difference: Array) -> bool:
    n = len(difference)
    if n < 2:
        return False
    return bool(difference.mean() > CHANCE * difference.std(ddof=1) / np.sqrt(n))


def _relative(errors: Mapping[str, Array], chosen: str) -> dict[str, float]:
    least = max(float(errors[chosen].sum()), np.finfo(float).tiny)
    return {law: float(np.sqrt(error.sum() / least)) for law, error in errors.items()}
