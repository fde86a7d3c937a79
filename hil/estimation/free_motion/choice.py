"""What the data choose: the law of friction of each axis, and the dead zone at low speed.

Alternatives are compared by the error of prediction on blocks that were held out, in turn. What is
usual, weighted least squares with the classical law, stands unless something richer is certainly
better. Of many alternatives that are worth nothing, the best looks better, too: so what counts is
the greatest t of all differences of squared errors, against the greatest t of the same differences
with signs of blocks drawn at random (White, A reality check for data snooping, Econometrica 68
(2000) 1097-1126; studentised, since alternatives scatter differently). Alternatives that predict
alike cost little in this way, and fewer than six blocks show nothing. Up to `NEGLIGIBLE` less of
the residual of the axis concerned is none. Chosen is the simplest that nothing beats; if one that
is simpler still predicts as well, that is. Nothing simpler than the usual is tried: it would save
an unknown or two and leave more of some other motion.

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
from hil.regression.layout import embedded
from hil.regression.least_squares import solved
from hil.regression.normal_equations import normal, successive

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
FOLDS = 12
"""Parts of the pieces that are held out in turn."""
CHANCE = 0.025
"""Probability of a difference by chance below which it is none: of 5 %, either side."""
FLIPS = 4096
"""Draws of signs: the probability is known within 0.0025."""
NEGLIGIBLE = 0.01
"""Growth of the held-out residual (rms) that tells nothing: the filters' corners make up to 0.008
where friction is Coulomb's and viscous exactly (two axes, white noise)."""
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


def simplest(errors: Mapping[str, Array], n_axes: int = 1) -> str:
    """Name of the first alternative that no other certainly beats.

    Parameters
    ----------
    errors : mapping of name to ndarray, shape (n_blocks,)
        Squared errors on held-out blocks of all that was tried, the simplest alternative first.
    n_axes : int
        Axes that the errors are of, weighted alike, where the alternatives are of one of them: its
        own residual is an n-th of theirs.
    """
    squares = np.array(list(errors.values()))
    sums = squares.sum(axis=1)
    enough = ((1.0 + NEGLIGIBLE) ** 2 - 1.0) * sums.min() / n_axes
    found = next(
        k
        for k, error in enumerate(squares)
        if sums[k] - sums.min() <= enough or not _certainly_positive(error - squares)
    )
    return list(errors)[int(np.flatnonzero(sums <= sums[found])[0])]


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
        N, v = fitted.information, fitted.vector
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
    return successive(0, n, min(FOLDS, n))


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


def _certainly_positive(gains: Array) -> bool:
    """Whether any row's mean over blocks is positive by more than chance; gains: (n_rows, n)."""
    n = gains.shape[1]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(FLIPS, n))
    t = float(_t(gains, np.ones((1, n))).max())
    by_chance = _t(gains, signs).max(axis=1) >= t * (1.0 - np.sqrt(np.finfo(float).eps))
    return t > 0.0 and bool(by_chance.mean() <= CHANCE)


def _t(gains: Array, signs: Array) -> Array:
    """Mean over its standard error, of each row of gains with each row of signs."""
    n = gains.shape[1]
    mean = signs @ gains.T / n
    variance = ((gains**2).mean(axis=1) - mean**2) / max(n - 1, 1)
    return np.asarray(mean / np.sqrt(np.maximum(variance, np.finfo(float).tiny)))


def _relative(errors: Mapping[str, Array], chosen: str) -> dict[str, float]:
    least = max(float(errors[chosen].sum()), np.finfo(float).tiny)
    return {law: float(np.sqrt(error.sum() / least)) for law, error in errors.items()}
