"""Joint regression over several kinds of recordings, with a weight factor per kind.

Within one kind of recordings weights are reciprocal residual variances, as for noise. But strokes
and free motions also differ in model error: friction drift, missing terms of friction laws. The
effect on the unknowns shows in groups left out, not in the size of residuals. So each kind has a
factor c_k on all of its weights, chosen to minimise the change of the recorded motions' torque when
groups are left out in turn,

    sum over kinds k of (n_k - 1) / n_k, sum over groups g of k:  d_g' Q d_g,
    d_g = (N - c_k S_g)^-1 c_k (s_g - S_g x),    N x = v,    N = sum_k c_k N_k,

the jackknife's variance of that torque (`hil.least_squares.uncertainty`). This variance includes
the weight of single groups: a kind with few groups for an unknown gets a smaller weight than its
residuals suggest. Errors that repeat with the motion show in no group of time, but in cells of
states; noise shows in both. So for a kind with cells the larger of both variances counts. The
additional uncertainty of a kind, B_k, propagates to N^-1 c_k N_k B_k (N^-1 c_k N_k)'. Q has the
inner products of the recorded columns, each channel divided by the square of its torque. The own
unknowns of each kind are eliminated first.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.least_squares.layout import embedded
from hil.least_squares.regression import Regression
from hil.least_squares.solving import inverse, solve_each, solved

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.least_squares.blocks import Blocks


MOST = 100.0
"""Maximum factor of a kind over another: larger factors gain nothing and lose precision."""


class Kind(NamedTuple):
    """Regression of a kind of recordings, with additional uncertainty.

    Attributes
    ----------
    regression : Regression
    cells : Blocks, optional
        Samples grouped in cells of states, which show model error.
    beside : ndarray, shape (n, n)
        Covariance of the first shared unknowns by this kind alone that does not appear between
        groups, such as from the choice of a friction law; none if n is 0.
    effect : ndarray, shape (n, m)
        Change of the first shared unknowns per unit of an invisible quantity, such as a torque
        constant; none if n is 0.
    """

    regression: Regression
    cells: Blocks | None = None
    beside: Array = np.zeros((0, 0))
    effect: Array = np.zeros((0, 1))


class Balanced(NamedTuple):
    """Joint regression of several kinds, and contribution of the kinds.

    Attributes
    ----------
    whole : Kind
    parts : tuple of ndarray, shape (n, n)
        Contribution of each kind's own estimate to the shared unknowns; the sum over kinds is 1.
    """

    whole: Kind
    parts: tuple[Array, ...]


def balance(kinds: Sequence[Kind], shared: Sequence[str]) -> Balanced:
    """Combine kinds into one regression over joined blocks, keeping the unknowns of every kind.

    Weights within a kind are reciprocal residual variances of the joint solution; factors weight
    whole kinds.

    Parameters
    ----------
    kinds : sequence of Kind
        Kinds without common channels.
    shared : sequence of str
        Names of the unknowns shared by the kinds.
    """
    if len(kinds) == 1:
        beside = embedded(kinds[0].beside, np.arange(len(kinds[0].beside)), len(shared))
        return Balanced(kinds[0]._replace(beside=beside), (np.eye(len(shared)),))
    parts = [kind.regression for kind in kinds]
    first, *others = (part.blocks for part in parts)
    blocks = first.joined(*others)
    # indices of the kept unknowns of each kind among those of all kinds
    order = {name: k for k, name in enumerate(blocks.layout.names)}
    named = [(part.layout.names, part.kept) for part in parts]
    kept = [np.array([order[names[k]] for k in own], dtype=np.intp) for names, own in named]
    found = Regression.weighed(blocks, np.unique(np.concatenate(kept)))
    weights = np.split(found.weights, np.cumsum([part.blocks.n_channels for part in parts])[:-1])
    weighed = [replace(part, weights=own) for part, own in zip(parts, weights, strict=True)]
    both = zip(kinds, weighed, strict=True)
    shares = Shares([kind._replace(regression=part) for kind, part in both], shared)
    c = shares.factors()
    scaled = [ck * own for ck, own in zip(c, weights, strict=True)]
    cells = [kind.cells for kind in kinds if kind.cells is not None]
    joined = cells[0].joined(*cells[1:]) if cells else None
    if joined is not None:
        joined = joined.expanded(blocks.shared, blocks.own, blocks.channels)
    own = tuple(shares.parts(c))
    effects = [G[:, : len(each.effect)] @ each.effect for G, each in zip(own, kinds, strict=True)]
    whole = replace(found, weights=np.concatenate(scaled))
    return Balanced(Kind(whole, joined, shares.extra_covariance(c), reduce(np.add, effects)), own)


class Shares:
    """Information of kinds of recordings about shared unknowns.

    Parameters
    ----------
    kinds : sequence of Kind
        Weighted regressions of the kinds.
    shared : sequence of str
        Names of the unknowns shared by the kinds.
    """

    def __init__(self, kinds: Sequence[Kind], shared: Sequence[str]) -> None:
        self._groups = [[_shares(kind.regression, shared)] for kind in kinds]
        for own, kind in zip(self._groups, kinds, strict=True):
            if kind.cells is not None:
                own.append(_shares(kind.regression.transfer(kind.cells), shared))
        self._whole = [own[0].S.sum(axis=0) for own in self._groups]
        self._vectors = [own[0].s.sum(axis=0) for own in self._groups]
        self._beside = [kind.beside for kind in kinds]
        self._Q = np.sum([_torque(kind.regression, shared) for kind in kinds], axis=0)

    def factors(self) -> Array:
        """Compute the weight factors of the kinds, shape (n_kinds,); the last is 1."""

        def spread(logarithms: Array) -> float:
            return float(np.log(max(self._variance(_factors(logarithms)), np.finfo(float).tiny)))

        start, most = np.zeros(len(self._groups) - 1), np.log(MOST)
        if not len(start):
            return np.ones(1)
        from scipy import optimize  # noqa: PLC0415 - one kind alone has nothing to be balanced

        bounds = [(-most, most)] * len(start)
        found = optimize.minimize(spread, start, method="Nelder-Mead", bounds=bounds)
        return _factors(found.x)

    def extra_covariance(self, c: Array) -> Array:
        """Compute the shared unknowns' covariance not visible between groups, shape (n, n)."""
        return propagate(self.parts(c), self._beside)

    def parts(self, c: Array) -> list[Array]:
        """Compute the kinds' contributions to the shared unknowns, shape (n, n) per kind."""
        N = self._information(c)
        return [solved(N, ck * own) for ck, own in zip(c, self._whole, strict=True)]

    def _information(self, c: Array) -> Array:
        found: Array = np.tensordot(c, self._whole, 1)
        return found

    def _variance(self, c: Array) -> float:
        """Compute the variance of the torque."""
        N = self._information(c)
        x, total = solved(N, np.tensordot(c, self._vectors, 1)), self.extra_covariance(c)
        for ck, own in zip(c, self._groups, strict=True):
            found = []
            for groups in (each.times(ck) for each in own):
                # leave out one group at a time
                d = solve_each(N - groups.S, groups.s - groups.S @ x)
                found.append((len(d) - 1) / len(d) * d.T @ d)
            total += max(found, key=lambda V: float(np.sum(self._Q * V)))
        return float(np.sum(self._Q * total))


def propagate(parts: Sequence[Array], covariances: Sequence[Array]) -> Array:
    """Propagate the kinds' covariances to the shared unknowns."""
    each = zip(parts, covariances, strict=True)
    found: Array = np.sum([G[:, : len(B)] @ B @ G[:, : len(B)].T for G, B in each], axis=0)
    return found


def _factors(logarithms: Array) -> Array:
    found: Array = np.exp(np.append(logarithms, 0.0))
    return found


class _Equations(NamedTuple):
    """Normal equations of groups for shared unknowns, shapes (n_groups, n, n) and (n_groups, n)."""

    S: Array
    s: Array

    def times(self, factor: float) -> _Equations:
        """Scale the equations by a factor."""
        return _Equations(factor * self.S, factor * self.s)


def _shares(part: Regression, shared: Sequence[str]) -> _Equations:
    """Compute the groups' equations for the shared unknowns, with own unknowns eliminated."""
    normal, names = part.normal, part.layout.names
    N, v = normal.information, normal.vector
    place = {names[k]: at for at, k in enumerate(part.kept)}
    of = [(to, place[name]) for to, name in enumerate(shared) if name in place]
    to, at = np.array(of, dtype=np.intp).T
    own = np.setdiff1d(np.arange(len(part.kept)), at)
    # own unknowns are `alone` for zero shared unknowns, and depend on shared unknowns by T
    T, alone = np.zeros((len(N), len(shared))), np.zeros(len(N))
    own_inverse = inverse(N[np.ix_(own, own)])
    T[at, to] = 1.0
    alone[own], T[own] = own_inverse @ v[own], -own_inverse @ N[own] @ T
    return _Equations(T.T @ normal.N @ T, (normal.v - normal.N @ alone) @ T)


def _torque(part: Regression, shared: Sequence[str]) -> Array:
    """Compute inner products of the shared columns, scaled per channel by the squared torque."""
    blocks = part.blocks.total
    heard = blocks.squares > 0
    at = blocks.place(*shared)
    products = blocks.products[0][heard][:, at[:, np.newaxis], at]
    found: Array = (products / blocks.squares[heard, np.newaxis, np.newaxis]).sum(axis=0)
    return found
