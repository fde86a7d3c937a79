"""What the data choose: the law of friction of each axis, and the dead zone at low speed.

Alternatives are compared on pieces of time that were held out (`hil.regression.choice`). What is
usual is weighted least squares with the classical law. Nothing simpler is tried: it would save an
unknown or two and leave more of some other motion.

Dead zones are compared on fast samples alone, the same for all: a fit that slow samples have
spoilt, where friction depends on the way since the last reversal, predicts fast ones worse. On all
samples it would always be the fit on all samples that seems best.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.friction_terms import COLUMNS, LAWS
from hil.estimation.free_motion.system import kept_unknowns, residual_weights, squares_left, summed
from hil.regression.choice import HeldOut, simplest
from hil.regression.normal_equations import normal

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products
    from hil.regression.normal_equations import Normal

    Array = NDArray[np.float64]

USUAL = "Coulomb and viscous"
"""Law that stands unless the data call for another."""
TRIED = tuple(LAWS)[tuple(LAWS).index(USUAL) :]
"""Laws, from the usual one on."""
MATERIAL = 0.05
"""Growth of a residual (rms) that nothing is worth, no dead zone and no positive mass matrix: by so
much the default may leave more than weighted least squares."""


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

    def equations(self, products: Products) -> Normal:
        """Equations of all unknowns, piece by piece, from the samples that are fitted."""
        return normal(summed(products.pieces, self.slowest), products.n_shared, self.weights)

    def solution(self, products: Products) -> Array:
        """Weighted least squares, shape (n,); 0 where a law has no such term."""
        return self.equations(products).solution(self.kept(products.n_shared))


def choose(products: Products) -> Choice:
    """Choose dead zone, then laws axis by axis, those of the others being the classical one first.

    A dead zone is none that leaves more of all samples on some axis, by more than `MATERIAL`, than
    weighted least squares does.
    """
    plain, n_shared = without_choice(products, weighted=True), products.n_shared
    whole, all_counts = summed(products.pieces), summed(products.counts)
    scored = normal(whole, n_shared, plain.weights)
    least = squares_left(whole, all_counts, n_shared, scored.solution(plain.kept(n_shared)))
    for slowest in sorted({_dead_zone(products, plain), 0}, reverse=True):
        pieces = summed(products.pieces, slowest)
        counts = summed(products.counts, slowest)
        kept = plain.kept(products.n_shared)
        weights = residual_weights(pieces, counts, products.n_shared, kept)
        system = normal(pieces.sum(axis=0, keepdims=True), products.n_shared, weights)
        held_out = HeldOut(normal(pieces, products.n_shared, weights), scored)
        laws, errors = list(plain.laws), []
        for axis in range(products.n_joints):
            others = [
                (law, _kept(products, (*laws[:axis], law, *laws[axis + 1 :]))) for law in TRIED
            ]
            found = {
                law: held_out.error(kept)
                for law, kept in others
                if _locks_nowhere(products, system.only(kept).solution(), kept, axis)
            }
            laws[axis] = simplest(found, products.n_joints)
            errors.append(_relative(found, laws[axis]))
        kept = _kept(products, laws)
        left = squares_left(whole, all_counts, n_shared, system.solution(kept))
        if np.all(left <= (1.0 + MATERIAL) ** 2 * least):
            break
    weights = residual_weights(pieces, counts, products.n_shared, kept)
    return Choice(slowest, tuple(laws), tuple(errors), weights)


def without_choice(products: Products, *, weighted: bool) -> Choice:
    """Coulomb's and viscous friction at all speeds; rows alike, or by residual variance."""
    n, law = products.n_joints, USUAL
    weights = np.ones(n)
    if weighted:
        kept = _kept(products, [law] * n)
        counts = summed(products.counts)
        weights = residual_weights(summed(products.pieces), counts, products.n_shared, kept)
    return Choice(0, (law,) * n, ({},) * n, weights)


def _locks_nowhere(products: Products, x: Array, kept: NDArray[np.intp], axis: int) -> bool:
    """Whether friction takes a share from 0 to 1 of the load, where a solution has such a term.

    A gear that took more would not move, and one that took less would push: such a solution makes
    up for something else.
    """
    load = products.n_shared + axis * len(COLUMNS) + COLUMNS.index("load")
    share = x[kept == load]
    return bool(np.all((share >= 0.0) & (share < 1.0)))


def _dead_zone(products: Products, plain: Choice) -> int:
    fast = products.pieces.shape[2] - 1
    kept = _kept(products, ["all"] * products.n_joints)
    scored = normal(summed(products.pieces, fast), products.n_shared, plain.weights)
    errors = {
        str(slowest): HeldOut(
            normal(summed(products.pieces, slowest), products.n_shared, plain.weights), scored
        ).error(kept)
        for slowest in range(fast)
    }
    return int(simplest(errors))


def _kept(products: Products, laws: Sequence[str]) -> NDArray[np.intp]:
    return kept_unknowns(products.n_shared, [LAWS[law] for law in laws])


def _relative(errors: Mapping[str, Array], chosen: str) -> dict[str, float]:
    least = max(float(errors[chosen].sum()), np.finfo(float).tiny)
    return {law: float(np.sqrt(error.sum() / least)) for law, error in errors.items()}
