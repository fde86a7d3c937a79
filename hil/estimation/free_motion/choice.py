"""What the data choose: the law of friction of each axis, and the dead zone at low speed.

Alternatives are compared on pieces of time that were held out (`hil.least_squares.choice`). What is
usual is weighted least squares with the classical law. Nothing simpler is tried: it would save an
unknown or two and leave more of some other motion.

Halves of the recordings, predicted from each other, do not decide: half of an exciting trajectory
leaves base parameters undetermined, and what these are wrong by is up to a hundred times what laws
differ by.

Dead zones are compared on fast samples alone, the same for all: a fit that slow samples have
spoilt, where friction depends on the way since the last reversal, predicts fast ones worse. On all
samples it would always be the fit on all samples that seems best.

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
taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.accumulation import SPEEDS
from hil.estimation.free_motion.offsets import only_directions
from hil.friction.search import TRIED, relative_errors
from hil.friction.terms import BENT, LAWS, USUAL
from hil.least_squares.choice import HeldOut, simplest
from hil.least_squares.regression import Regression

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.free_motion.accumulation import Products
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.layout import Layout

MATERIAL = 0.05
"""Growth of a residual (rms) that nothing is worth, no dead zone and no positive mass matrix: by so
much the default may leave more than weighted least squares."""
SHARE = 0.6
"""Share of the spread of alternatives that counts: over twins of seven robots, twelve seeds each,
errors are 0.6 (seven axes) to 1.2 times (portal) as large as is stated then."""
OTHER_LAWS = ("cube root", "arc tangent", "all speeds and load", "all")
"""Laws that hold most of what friction does with speed."""


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

    def of(self, blocks: Blocks) -> Regression:
        """Regression over blocks with the unknowns that the laws leave."""
        return Regression(blocks, self.weights, kept_by(blocks.layout, self.laws))

    def fitted(self, products: Products) -> Regression:
        """Regression over the pieces of time, of the samples that are fitted."""
        return self.of(products.pieces[self.slowest])


def kept_by(layout: Layout, laws: Sequence[str]) -> Indices:
    """Unknowns that laws of friction, one for each axis, leave.

    With Coulomb's friction there is how it bends, whose column is 0 where it turns round at once.
    """
    return layout.kept([law_terms(law) for law in laws])


def law_terms(law: str) -> tuple[str, ...]:
    """Terms of a law; with Coulomb's friction there is how it bends."""
    terms = LAWS[law]
    return (*terms, BENT) if "Coulomb" in terms else terms


def usual(blocks: Blocks) -> Regression:
    """Coulomb's and viscous friction, rows by residual variance."""
    return Regression.weighed(blocks, kept_by(blocks.layout, [USUAL] * blocks.n_channels))


def without_choice(products: Products, *, weighted: bool) -> Choice:
    """Coulomb's and viscous friction at all speeds; rows alike, or by residual variance."""
    n = products.n_joints
    weights = usual(products.pieces[0]).weights if weighted else np.ones(n)
    return Choice(0, (USUAL,) * n, ({},) * n, weights)


def choose(
    products: Products, tried: Sequence[str] = TRIED, plain_left: Array | None = None
) -> Choice:
    """Choose dead zone, then laws axis by axis, those of the others being the classical one first.

    A dead zone is none that leaves more of all samples on some axis, by more than `MATERIAL`, than
    weighted least squares does.

    Parameters
    ----------
    tried : sequence of str
        Laws, the simplest first.
    plain_left : ndarray, shape (n_joints,), optional
        Mean square of what weighted least squares leaves without presliding, where there is some.
        Then there is a dead zone, unless it leaves more than that, by more than `MATERIAL` over all
        axes: a model of friction after a reversal lacks something, which looks like inertia.
    """
    whole, n = products.pieces[0], products.n_joints
    plain = usual(whole)
    scored, least = whole.normal(plain.weights), whole.mean_squares(plain.solution)
    zone = dead_zone_of(products, plain.weights)
    if plain_left is not None:
        zone, least = max(zone, 1), np.maximum(least, plain_left)
    for slowest in sorted({zone, 0}, reverse=True):
        fitted = products.pieces[slowest]
        weights = usual(fitted).weights
        pieces, total = fitted.normal(weights), fitted.total.normal(weights)
        held_out = HeldOut(pieces, scored)
        laws, errors = [tried[0]] * n, []
        for axis in range(n):
            others = {
                law: (*laws[:axis], law, *laws[axis + 1 :])
                for law in _different(tried, products, axis)
            }
            kept = {law: kept_by(whole.layout, each) for law, each in others.items()}
            load = whole.layout.index("load", axis)
            # a gear of which friction took more than the load would not move, and one of which it
            # took less than nothing would push: such a solution makes up for something else
            found = held_out.errors({
                law: each for law, each in kept.items()
                if len(tried) == 1 or 0.0 <= total.solution(each)[load] < 1.0
            })  # fmt: skip
            laws[axis] = simplest(found, n)
            errors.append(relative_errors(found, laws[axis]))
        kept_laws = kept_by(whole.layout, laws)
        left = whole.mean_squares(total.solution(kept_laws))
        more = left / np.maximum(least, np.finfo(float).tiny)
        if (more.max() if plain_left is None else more.mean()) <= (1.0 + MATERIAL) ** 2:
            break
    weights = Regression.weighed(fitted, kept_laws).weights
    return Choice(slowest, tuple(laws), tuple(errors), weights)


def _different(tried: Sequence[str], products: Products, axis: int) -> list[str]:
    """Laws that differ by terms that one axis shows: ripple of an unknown gear shows none."""
    whole = products.pieces[0]
    squares = np.einsum("gii->i", whole.products[:, axis])
    of_terms: dict[frozenset[str], str] = {}
    for law in tried:
        terms = law_terms(law)
        shown = compress(terms, squares[whole.place(*terms)] > 0)
        of_terms.setdefault(frozenset(shown), law)
    return list(of_terms.values())


def dead_zone_of(products: Products, weights: Array) -> int:
    """First class of speed that is fitted, by what all terms predict of the fastest samples."""
    every = range(len(SPEEDS) + 1)
    *tried, scored = (products.pieces[slowest].normal(weights) for slowest in every)
    kept = kept_by(products.layout, ["all"] * products.n_joints)
    errors = {str(k): HeldOut(each, scored).error(kept) for k, each in enumerate(tried)}
    return int(simplest(errors))


def covariance_of_choices(products: Products, choice: Choice) -> Array:
    """Covariance from one choice to another, of base parameters, coupled motors and offsets.

    Returns
    -------
    ndarray, shape (n, n)
        Of all unknowns; 0 of the other terms of friction, which mean something else in each law,
        and so does the offset of an axis that moves in one direction only.
    """
    layout, n = products.layout, products.n_joints
    one_way = only_directions(products.pieces[1])
    whole = products.pieces[0].normal(choice.weights)
    zones = range(choice.slowest, len(SPEEDS))
    fits = {zone: products.pieces[zone].normal(choice.weights) for zone in zones}
    common = layout.kept([() if axis in one_way else ("offset",) for axis in range(n)])

    def solved(zone: int, laws: Sequence[str]) -> tuple[Array, float]:
        kept, equations = kept_by(layout, laws), fits[zone]
        error = HeldOut(equations, whole).error(kept)
        return equations.solution(kept)[common], float(error.sum())

    x, least = solved(choice.slowest, choice.laws)
    total, weights = np.zeros((layout.size, layout.size)), 1.0
    others = [(choice.slowest, (law,) * n) for law in OTHER_LAWS]
    for other in (*((zone, choice.laws) for zone in zones), *others):
        found, error = solved(*other)
        weight = min(1.0, np.sqrt(least / max(error, np.finfo(float).tiny)))
        total[np.ix_(common, common)] += weight * np.outer(found - x, found - x)
        weights += weight
    return SHARE * total / weights
