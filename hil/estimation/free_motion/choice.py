"""Choose the friction law of each axis, and the dead zone at low speed, from the data.

Alternatives are compared on held-out pieces of time (`hil.least_squares.choice`). The reference is
weighted least squares with the classical law. Nothing simpler is tried: a simpler law would save an
unknown or two and enlarge the residuals of some other motion.

Mutual prediction of halves of the recordings does not decide: half of an exciting trajectory leaves
base parameters undetermined, whose errors are up to a hundred times the differences between laws.

Dead zones are compared on equal fast samples: if friction depends on the distance since the last
reversal, a fit spoilt by slow samples predicts fast samples worse. On all samples the fit to all
samples would always seem best.

The chosen law is not the truth. Its errors repeat with the motion, and if the motion repeats
itself, as exciting trajectories do, neither blocks of time nor cells of states show much of these
errors. But another law has other errors. Alternatives m are therefore taken as draws: with weights
w_m, the mean squared error on held-out blocks of the choice over that of the alternative, they add

    V = sum w_m (x_m - x)(x_m - x)' / sum w_m

to the covariance of the unknowns common to all laws, as averaging over models would (J. A. Hoeting
et al., Bayesian model averaging, Statistical Science 14 (1999) 382-417, eq. 3). The torque of x_m -
x is at most of the size of the alternative's error, so with these weights no alternative adds more
to the variance of torques than the choice leaves: one that lacks samples for its unknowns, as a
wide dead zone of slow motions, is wrong by its own error, not by a law. Dead zones smaller than the
chosen one are no alternatives: slow samples bias the estimates by more than chance, though such a
fit describes slow samples best. Alternatives include laws that would never be chosen, some with
larger errors than the choice, so only the share `SHARE` of V is taken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.accumulation import SPEEDS
from hil.estimation.free_motion.offsets import only_directions
from hil.friction.direction import Direction
from hil.friction.search import TRIED, relative_errors
from hil.friction.terms import BENT, LAWS, USUAL, friction_columns
from hil.least_squares.choice import HeldOut, simplest
from hil.least_squares.regression import Regression

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.free_motion.accumulation import Products
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.layout import Layout
    from hil.least_squares.regression import Fit


MATERIAL = 0.05
"""Largest growth of a residual (rms), over weighted least squares, accepted for a dead zone or a
positive mass matrix."""
SHARE = 0.6
"""Weight of the spread of alternatives in the covariance. With this weight the errors on twins of
seven robots, twelve seeds each, are 0.6 (seven axes) to 1.2 times (portal) the stated errors.
"""
MOST = 0.5
"""Share of a mean square above which a torque does not follow the model: more is left than
explained."""
OTHER_LAWS = ("cube root", "arc tangent", "all speeds and load", "all")
"""Alternative laws, which cover most forms of friction over speed."""


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """Chosen friction laws and dead zone, with the errors for the decision.

    Attributes
    ----------
    slowest : int
        First fitted class of speed; 0 without a dead zone.
    laws : tuple of str
        Names of the laws, by axis.
    held_out : tuple of dict
        By axis: root mean square of the held-out error by law, over that of the chosen law.
    weights : ndarray, shape (n_joints,)
        Row weights of the axes.
    """

    slowest: int
    laws: tuple[str, ...]
    held_out: tuple[dict[str, float], ...]
    weights: Array

    def regression(self, blocks: Blocks) -> Regression:
        """Return the regression over blocks with the unknowns of the chosen laws."""
        return Regression(blocks, self.weights, kept_by(blocks.layout, self.laws))

    def fitted(self, products: Products) -> Regression:
        """Return the regression over the pieces of time, for the fitted samples."""
        return self.regression(products.pieces[self.slowest])


def kept_by(layout: Layout, laws: Sequence[str]) -> Indices:
    """Return the unknowns of friction laws, given by axis.

    Coulomb friction includes the bend term, whose column is 0 if friction reverses at once.
    """
    return layout.kept([law_terms(law) for law in laws])


def law_terms(law: str) -> tuple[str, ...]:
    """Return the terms of a law; Coulomb friction includes the bend term."""
    terms = LAWS[law]
    return (*terms, BENT) if "Coulomb" in terms else terms


def _braking(terms: Sequence[str]) -> Array:
    """Return columns of the friction against the motion without load, shape (4, n_terms).

    Speeds are a quarter to all of the reference speed, the mean of both directions.
    """
    forth, still = np.array([0.25, 0.5, 0.75, 1.0]), np.zeros(8)
    u = np.append(forth, -forth)
    columns = friction_columns(u, Direction(np.sign(u), still), still, still, still, terms=terms)
    # offsets and asymmetry cancel between the two directions
    return np.asarray((columns[:4] - columns[4:]) / 2)


def _own(layout: Layout, axis: int) -> Indices:
    return layout.place(axis)[len(layout.shared) :]


def driving_axes(fit: Fit) -> tuple[int, ...]:
    """Return the axes, from 0, whose friction law significantly supplies power at some speed."""
    brakes, found = _braking(fit.layout.own), []
    for axis in range(fit.layout.n_channels):
        own = _own(fit.layout, axis)
        V = fit.covariance[np.ix_(own, own)]
        error = np.sqrt(np.einsum("nk,kl,nl->n", brakes, V, brakes).clip(0.0))
        # friction drives an axis only if significant, by 2 standard errors
        if (brakes @ fit.x[own] < -2.0 * error).any():
            found.append(axis)
    return tuple(found)


def _is_friction(total: Regression, pieces: Blocks, axis: int) -> bool:
    """Check that a law brakes: others compensate for another model error.

    Load friction above the load would block a gear, and negative friction would drive it.
    """
    x, layout = total.solution, total.layout
    if not 0.0 <= x[layout.index("load", axis)] < 1.0:
        return False
    brakes = (_braking(layout.own) @ x[_own(layout, axis)] >= 0.0).all()
    return bool(brakes) or axis not in driving_axes(total.transfer(pieces).fit("clusters"))


def usual(blocks: Blocks) -> Regression:
    """Return the regression with Coulomb and viscous friction, weighted by residual variance."""
    return Regression.weighed(blocks, kept_by(blocks.layout, [USUAL] * blocks.n_channels))


def classical_choice(products: Products, *, weighted: bool) -> Choice:
    """Return Coulomb and viscous friction at all speeds, optionally with weighted rows."""
    n = products.n_joints
    weights = usual(products.pieces[0]).weights if weighted else np.ones(n)
    return Choice(0, (USUAL,) * n, ({},) * n, weights)


def choose(
    products: Products, tried: Sequence[str] = TRIED, plain_left: Array | None = None
) -> Choice:
    """Choose the dead zone, then the laws of the axes, starting from classical laws.

    A dead zone is rejected if the residual of all samples on some axis exceeds that of weighted
    least squares by more than `MATERIAL`.

    Parameters
    ----------
    tried : sequence of str
        Laws, the simplest first.
    plain_left : ndarray, shape (n_joints,), optional
        Mean squared residual of weighted least squares without presliding, if presliding was found.
        Then a dead zone is used unless its residual exceeds `plain_left` by more than `MATERIAL`
        over all axes: models of friction after a reversal are incomplete, and the error looks like
        inertia.
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
        summed, held_out = fitted.total, HeldOut(fitted.normal(weights), scored)
        laws, errors = [tried[0]] * n, []
        for axis in range(n):
            others = {
                law: (*laws[:axis], law, *laws[axis + 1 :])
                for law in _different(tried, products, axis)
            }
            kept = {law: kept_by(whole.layout, each) for law, each in others.items()}
            found = held_out.errors({
                law: each for law, each in kept.items()
                if law == tried[0] or _is_friction(Regression(summed, weights, each), fitted, axis)
            })  # fmt: skip
            laws[axis] = simplest(found, n)
            errors.append(relative_errors(found, laws[axis]))
        kept_laws = kept_by(whole.layout, laws)
        left = whole.mean_squares(Regression(summed, weights, kept_laws).solution)
        more = left / np.maximum(least, np.finfo(float).tiny)
        if (more.max() if plain_left is None else more.mean()) <= (1.0 + MATERIAL) ** 2:
            break
    weights = Regression.weighed(fitted, kept_laws).weights
    return Choice(slowest, tuple(laws), tuple(errors), weights)


def _different(tried: Sequence[str], products: Products, axis: int) -> list[str]:
    """Return laws with different visible terms on an axis (no ripple of an unknown gear)."""
    whole = products.pieces[0]
    squares = np.einsum("gii->i", whole.products[:, axis])
    of_terms: dict[frozenset[str], str] = {}
    for law in tried:
        terms = law_terms(law)
        shown = compress(terms, squares[whole.place(*terms)] > 0)
        of_terms.setdefault(frozenset(shown), law)
    return list(of_terms.values())


def dead_zone_of(products: Products, weights: Array) -> int:
    """Return the first fitted class of speed, by predictions of the fastest samples."""
    every = range(len(SPEEDS) + 1)
    *tried, scored = (products.pieces[slowest].normal(weights) for slowest in every)
    kept = kept_by(products.layout, ["all"] * products.n_joints)
    errors = {str(k): HeldOut(each, scored).error(kept) for k, each in enumerate(tried)}
    return int(simplest(errors))


def covariance_of_choices(products: Products, choice: Choice) -> Array:
    """Return the covariance of the unknowns between alternative laws and dead zones.

    Returns
    -------
    ndarray, shape (n, n)
        Covariance of all unknowns, nonzero for base parameters, coupled motors and offsets. Other
        friction terms differ in meaning between laws, as does the offset of an axis that moves in
        one direction only.
    """
    layout, n = products.layout, products.n_joints
    one_way = only_directions(products.ways)
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
        weight = min(1.0, least / max(error, np.finfo(float).tiny))
        total[np.ix_(common, common)] += weight * np.outer(found - x, found - x)
        weights += weight
    return SHARE * total / weights


def held_axes(pieces: Blocks, still: Sequence[int]) -> tuple[int, ...]:
    """Return the axes among `still`, from 0, held by a brake or static friction: without a say.

    A brake carries all weight and reactions: the recorded torque is constant but for noise, and the
    equation 0 = A p bends the parameters of all axes. Such equations are left out if all columns
    together predict the torque in held-out pieces of time no better than a constant.

    Parameters
    ----------
    pieces : Blocks
        By piece of time, a channel per axis.
    still : sequence of int
        Axes at rest.
    """
    return tuple(axis for axis in still if _share_left(pieces, axis, ("offset",)) >= 1.0)


def yielding_axes(pieces: Blocks, near: Sequence[int]) -> tuple[int, ...]:
    """Return the axes among `near`, from 0, that only give way to the motion of other axes.

    Such an axis moves within the presliding distance, or by jerks. Any torque up to static friction
    holds it, so all columns and friction together leave most of its mean square in held-out pieces
    of time.

    Parameters
    ----------
    pieces : Blocks
        By piece of time, a channel per axis.
    near : sequence of int
        Axes that hardly move.
    """
    return tuple(axis for axis in near if _share_left(pieces, axis, pieces.layout.own) > MOST)


def _share_left(pieces: Blocks, axis: int, own: Sequence[str]) -> float:
    """Return the squared error of an axis in held-out pieces, over that of a constant torque.

    `own` are the fitted unknowns of the axis beside the shared ones.
    """
    products = np.zeros_like(pieces.products)
    products[:, axis] = pieces.products[:, axis]
    equations = replace(pieces, products=products).normal(np.ones(pieces.n_channels))
    held_out, layout = HeldOut(equations, equations), pieces.layout
    every = [*range(len(pieces.shared)), *(layout.index(name, axis) for name in own)]
    constant = float(held_out.error(np.array([layout.index("offset", axis)])).sum())
    return float(held_out.error(np.array(every)).sum()) / constant if constant else np.inf
