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
Q has the inner products of the recorded columns, each channel over the square of its torque. The
own unknowns of each kind are eliminated first.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import optimize

from hil.least_squares.regression import Regression
from hil.least_squares.solving import inverse, solved, solved_each

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.least_squares.blocks import Blocks


class Kind(NamedTuple):
    """A regression, and the same samples in cells of states, where the model's lacks show."""

    regression: Regression
    cells: Blocks | None = None


def balanced(kinds: Sequence[Kind], shared: Sequence[str]) -> Kind:
    """One regression over the blocks of all, each with the unknowns that it kept.

    Weights within a kind are residual variances of the solution of all; `factors` say how much a
    kind counts.

    Parameters
    ----------
    kinds : sequence of Kind
        No channel of one is a channel of another.
    shared : sequence of str
        Names of the unknowns that they share.
    """
    parts = [kind.regression for kind in kinds]
    first, *others = (part.blocks for part in parts)
    blocks = first.joined(*others)
    kept = [_places(part.blocks, part.kept, blocks) for part in parts]
    found = Regression.weighed(blocks, np.unique(np.concatenate(kept)))
    weights = np.split(found.weights, np.cumsum([part.blocks.n_channels for part in parts])[:-1])
    weighed = [replace(part, weights=own) for part, own in zip(parts, weights, strict=True)]
    scaled = [c * own for c, own in zip(factors(weighed, shared), weights, strict=True)]
    cells = [kind.cells for kind in kinds if kind.cells is not None]
    joined = cells[0].joined(*cells[1:]) if cells else None
    if joined is not None:
        joined = joined.expanded(blocks.shared, blocks.own, blocks.channels)
    return Kind(replace(found, weights=np.concatenate(scaled)), joined)


def _places(of: Blocks, kept: Indices, among: Blocks) -> Indices:
    """Places of kept unknowns of some blocks among those of others that have them all."""
    names, order = of.layout.names, {name: k for k, name in enumerate(among.layout.names)}
    return np.array([order[names[k]] for k in kept], dtype=np.intp)


def factors(parts: Sequence[Regression], shared: Sequence[str]) -> Array:
    """Factors on the weights of regressions that share unknowns, shape (n_parts,); the last is 1.

    Parameters
    ----------
    parts : sequence of Regression
    shared : sequence of str
        Names of the unknowns that they share.
    """
    shares = [_shares(part, shared) for part in parts]
    Q = np.sum([_torque(part, shared) for part in parts], axis=0)

    def factors_of(logarithms: Array) -> Array:
        found: Array = np.exp(np.append(logarithms, 0.0))
        return found

    def spread(logarithms: Array) -> float:
        """Logarithm of the torque's variance."""
        c = factors_of(logarithms)
        groups = [each.times(ck) for ck, each in zip(c, shares, strict=True)]
        N, v = (sum(x.sum(axis=0) for x in both) for both in zip(*groups, strict=True))
        x, total = solved(N, v), 0.0
        for S, s in groups:
            d = solved_each(N - S, s - S @ x)
            total += (len(d) - 1) / len(d) * float(np.einsum("gi,ij,gj->", d, Q, d))
        return float(np.log(max(total, np.finfo(float).tiny)))

    found = optimize.minimize(spread, np.zeros(len(parts) - 1), method="Nelder-Mead")
    return factors_of(found.x)


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
