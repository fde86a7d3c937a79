"""Several regressions that share unknowns as one, and how much each of them is to count.

Within one kind of recordings weights follow from what the solution leaves, as if that were noise.
But strokes and free motions leave different things besides: friction that drifts, laws that lack a
shape. What these do to the unknowns shows where groups are left out, not in the size of residuals.
So each kind counts by a factor c_k on all of its weights, such that leaving out groups in turn
changes the torque of the recorded motions least,

    sum over kinds k of (n_k - 1) / n_k, sum over groups g of k:  d_g' Q d_g,
    d_g = (N - c_k S_g)^-1 c_k (s_g - S_g x),    N x = v,    N = sum_k c_k N_k,

the jackknife's variance of that torque (`hil.least_squares.uncertainty`). It also counts what
single groups carry: a kind with few of them for an unknown is worth less than its residuals say.
What repeats with the motion shows in no group of time, but in cells of states; noise is in both, so
of a kind that has cells the larger variance counts; intervals add both, to be too wide rather than
too narrow. And what a kind alone would leave uncertain besides, B_k, comes to
N^-1 c_k N_k B_k (N^-1 c_k N_k)' of all. Q has the inner products of the recorded columns, each
channel over the square of its torque. The own unknowns of each kind are eliminated first.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.least_squares.layout import embedded
from hil.least_squares.regression import Regression
from hil.least_squares.solving import inverse, solved, solved_each

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.least_squares.blocks import Blocks


MOST = 100.0
"""Greatest factor of one kind over another: beyond it nothing is gained, and numbers are lost."""


class Kind(NamedTuple):
    """A regression, and what else its own samples leave uncertain.

    Attributes
    ----------
    regression : Regression
    cells : Blocks, optional
        The same samples in cells of states, where the model's lacks show.
    beside : ndarray, shape (n, n)
        Covariance of the first shared unknowns, were they found from this kind alone, that no group
        shows, such as from one law of friction to another; none where n is 0.
    effect : ndarray, shape (n, m)
        Change of these per unit of what no group shows either, such as a torque constant; none
        where n is 0.
    """

    regression: Regression
    cells: Blocks | None = None
    beside: Array = np.zeros((0, 0))
    effect: Array = np.zeros((0, 1))


class Balanced(NamedTuple):
    """Several kinds as one, and how it follows each of them.

    Attributes
    ----------
    whole : Kind
    parts : tuple of ndarray, shape (n, n)
        What of the shared unknowns that each kind alone would have is in those of all; together 1.
    """

    whole: Kind
    parts: tuple[Array, ...]


def balanced(kinds: Sequence[Kind], shared: Sequence[str]) -> Balanced:
    """One regression over the blocks of all, each with the unknowns that it kept.

    Weights within a kind are residual variances of the solution of all; factors say how much a kind
    counts.

    Parameters
    ----------
    kinds : sequence of Kind
        No channel of one is a channel of another.
    shared : sequence of str
        Names of the unknowns that they share.
    """
    if len(kinds) == 1:
        beside = embedded(kinds[0].beside, np.arange(len(kinds[0].beside)), len(shared))
        return Balanced(kinds[0]._replace(beside=beside), (np.eye(len(shared)),))
    parts = [kind.regression for kind in kinds]
    first, *others = (part.blocks for part in parts)
    blocks = first.joined(*others)
    kept = [_places(part.blocks, part.kept, blocks) for part in parts]
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
    return Balanced(Kind(whole, joined, shares.beside(c), reduce(np.add, effects)), own)


def _places(of: Blocks, kept: Indices, among: Blocks) -> Indices:
    """Places of kept unknowns of some blocks among those of others that have them all."""
    names, order = of.layout.names, {name: k for k, name in enumerate(among.layout.names)}
    return np.array([order[names[k]] for k in kept], dtype=np.intp)


class Shares:
    """What kinds of recordings say of the unknowns that they share.

    Parameters
    ----------
    kinds : sequence of Kind
        Weighted.
    shared : sequence of str
        Names of the unknowns that they share.
    """

    def __init__(self, kinds: Sequence[Kind], shared: Sequence[str]) -> None:
        self._groups = [
            [_shares(part, shared) for part in (kind.regression, *_of_states(kind))]
            for kind in kinds
        ]
        self._whole = [own[0].S.sum(axis=0) for own in self._groups]
        self._vectors = [own[0].s.sum(axis=0) for own in self._groups]
        self._beside = [kind.beside for kind in kinds]
        self._Q = np.sum([_torque(kind.regression, shared) for kind in kinds], axis=0)

    def factors(self) -> Array:
        """Factors on the weights of the kinds, shape (n_kinds,); the last is 1."""

        def spread(logarithms: Array) -> float:
            return float(np.log(max(self._variance(_factors(logarithms)), np.finfo(float).tiny)))

        start, most = np.zeros(len(self._groups) - 1), np.log(MOST)
        if not len(start):
            return np.ones(1)
        from scipy import optimize  # noqa: PLC0415 - one kind alone has nothing to be balanced

        bounds = [(-most, most)] * len(start)
        found = optimize.minimize(spread, start, method="Nelder-Mead", bounds=bounds)
        return _factors(found.x)

    def beside(self, c: Array) -> Array:
        """Covariance of the shared unknowns from what no group shows, shape (n, n)."""
        return carried(self.parts(c), self._beside)

    def parts(self, c: Array) -> list[Array]:
        """What of the shared unknowns of each kind is in those of all, shape (n, n) each."""
        N = self._information(c)
        return [solved(N, ck * own) for ck, own in zip(c, self._whole, strict=True)]

    def _information(self, c: Array) -> Array:
        found: Array = np.tensordot(c, self._whole, 1)
        return found

    def _variance(self, c: Array) -> float:
        """Of the torque."""
        N = self._information(c)
        x, total = solved(N, np.tensordot(c, self._vectors, 1)), self.beside(c)
        for ck, own in zip(c, self._groups, strict=True):
            of_groups = [_left_out(N, x, each.times(ck)) for each in own]
            total += max(of_groups, key=lambda V: float(np.sum(self._Q * V)))
        return float(np.sum(self._Q * total))


def carried(parts: Sequence[Array], covariances: Sequence[Array]) -> Array:
    """Covariance of the shared unknowns from those that each kind alone would have of the first."""
    each = zip(parts, covariances, strict=True)
    found: Array = np.sum([G[:, : len(B)] @ B @ G[:, : len(B)].T for G, B in each], axis=0)
    return found


def _factors(logarithms: Array) -> Array:
    found: Array = np.exp(np.append(logarithms, 0.0))
    return found


def _of_states(kind: Kind) -> tuple[Regression, ...]:
    return () if kind.cells is None else (kind.regression.of(kind.cells),)


def _left_out(N: Array, x: Array, groups: _Equations) -> Array:
    """Covariance by leaving out groups in turn."""
    d = solved_each(N - groups.S, groups.s - groups.S @ x)
    found: Array = (len(d) - 1) / len(d) * d.T @ d
    return found


class _Equations(NamedTuple):
    """What groups say of the shared unknowns, shapes (n_groups, n, n) and (n_groups, n)."""

    S: Array
    s: Array

    def times(self, factor: float) -> _Equations:
        """The same, weighted."""
        return _Equations(factor * self.S, factor * self.s)


def _shares(part: Regression, shared: Sequence[str]) -> _Equations:
    """What groups say of the shared unknowns, their own ones eliminated."""
    normal, names = part.normal, part.layout.names
    N, v = normal.information, normal.vector
    place = {names[k]: at for at, k in enumerate(part.kept)}
    of = [(to, place[name]) for to, name in enumerate(shared) if name in place]
    to, at = np.array(of, dtype=np.intp).T
    own = np.setdiff1d(np.arange(len(part.kept)), at)
    # what its own unknowns are where the shared ones are zero, and how they follow these
    T, alone = np.zeros((len(N), len(shared))), np.zeros(len(N))
    own_inverse = inverse(N[np.ix_(own, own)])
    T[at, to] = 1.0
    alone[own], T[own] = own_inverse @ v[own], -own_inverse @ N[own] @ T
    return _Equations(T.T @ normal.N @ T, (normal.v - normal.N @ alone) @ T)


def _torque(part: Regression, shared: Sequence[str]) -> Array:
    """Inner products of the shared columns, each channel over the square of its torque."""
    blocks = part.blocks.total
    heard = blocks.squares > 0
    at = blocks.place(*shared)
    products = blocks.products[0][heard][:, at[:, np.newaxis], at]
    found: Array = (products / blocks.squares[heard, np.newaxis, np.newaxis]).sum(axis=0)
    return found
