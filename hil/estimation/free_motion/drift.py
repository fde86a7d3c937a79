"""Level of friction that changes while one measures, axis by axis.

Friction falls while gears warm and lubricant is stirred. In a recording of some minutes that shows:
the level of an axis's friction is then

    F(q, qd, t) = F(q, qd) (1 + sum d_k h_k(t)),

linear between instants spread evenly over the time recorded, with the mean over all pieces 0. F is
what a law finds of the whole recording, without offset and ripple, so that all else stays linear in
d_k. How many instants there are, or none, is chosen as a law is: the fewest that predict held-out
blocks no worse than the best, friction being interpolated over blocks that are left out. A level
that does not change is never taken to change where this predicts worse. Instants are no closer than
`APART`: over less time the level would follow the motion.

Cells of states have no time, and the level in them is the mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from hil.friction.terms import BENT, COLUMNS
from hil.least_squares.choice import FOLDS, HeldOut, simplest
from hil.least_squares.normal_equations import Normal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice
    from hil.least_squares.layout import Layout

APART = 60.0
"""Time between instants at which a level is found, at least [s]."""
SPANS = (0, 1, 2, 4, 6)
"""Spans between such instants that are tried; held-out blocks must be shorter."""
CHANGES = ("Coulomb", "viscous", "cube root", "arc tangent", "quadratic", "load", BENT)
"""Terms whose level changes together."""


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """Columns of levels that change.

    Attributes
    ----------
    spans : tuple of int
        Of each axis; 0 where its friction keeps its level.
    friction : ndarray, shape (n_joints, n_columns)
        Coefficients of what changes its level.
    """

    spans: tuple[int, ...]
    friction: Array

    @classmethod
    def none(cls, n_joints: int) -> Drift:
        """All levels stay."""
        return cls((0,) * n_joints, np.zeros((n_joints, len(COLUMNS))))

    def names(self, axis: int) -> list[str]:
        """Unknown levels of one axis at each instant but the first."""
        return [f"level {axis + 1} at {k}" for k in range(1, self.spans[axis] + 1)]

    def applied(self, products: Products) -> Products:
        """Products with a shared column for each instant but the first of every axis that drifts.

        The columns are the last of the shared ones, axis after axis.
        """
        if not any(self.spans):
            return products
        n_shared, added = 1 + len(products.layout.shared), {}
        for axis, friction in enumerate(self.friction):
            hats = levels(products.n_pieces, self.spans[axis])
            for name, hat in zip(self.names(axis), hats.T, strict=True):
                added[name] = np.zeros((len(hat), products.n_joints, n_shared + len(COLUMNS)))
                added[name][:, axis, n_shared:] = np.outer(hat, friction)
        return products.recast(added=added)

    def found(self, x: Array, layout: Layout, n_pieces: int) -> tuple[Array, ...]:
        """Level of each axis at its instants, over the mean; empty where it stays.

        Parameters
        ----------
        x : ndarray, shape (n,)
            Solution with the columns of `applied`.
        """
        each = []
        for axis, spans in enumerate(self.spans):
            ends = np.linspace(0.0, 1.0, spans + 1)
            hats = _hats(ends, spans) - _hats(_middles(n_pieces), spans).mean(axis=0)
            change = hats @ x[[layout.index(name) for name in self.names(axis)]] if spans else ()
            each.append(1.0 + np.array(change))
        return tuple(each)


def levels(n_pieces: int, spans: int) -> Array:
    """Change of the level in each piece for one at each instant but the first, mean 0.

    Shape (n_pieces, spans).
    """
    found = _hats(_middles(n_pieces), spans)
    return np.asarray(found - found.mean(axis=0))


def _middles(n_pieces: int) -> Array:
    return np.asarray((np.arange(n_pieces) + 0.5) / n_pieces)


def _hats(share: Array, spans: int) -> Array:
    """Linear between instants, 1 at one of them; without that of the first."""
    away = share[:, np.newaxis] * spans - np.arange(1, spans + 1)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(away)))


def find_drift(products: Products, choice: Choice, duration: float) -> Drift:
    """Find which axes' friction changes its level, and over how many spans of time.

    Parameters
    ----------
    duration : float
        Of all recordings [s].
    """
    folds = min(FOLDS, products.n_pieces)
    possible = [n for n in SPANS if n * APART <= duration and 2 * n <= folds]
    n, changes = products.n_joints, [term in CHANGES for term in COLUMNS]
    if len(possible) <= 1:
        return Drift.none(n)
    fitted = choice.fitted(products)
    own = fitted.solution[len(fitted.layout.shared) :].reshape(n, -1)
    friction = np.where(changes, own, 0.0)
    shared = np.zeros((len(fitted.layout.shared), n))
    changing = np.vstack([shared, block_diag(*friction[:, :, np.newaxis])])[fitted.kept]
    search, spans = _Search(fitted.normal, changing), [0] * n
    for axis in range(n):
        tried = {str(k): search.error((*spans[:axis], k, *spans[axis + 1 :])) for k in possible}
        spans[axis] = int(simplest(tried, n))
    return Drift(tuple(spans), friction)


class _Search:
    """Equations of the friction as it is, to which those of its changes are added.

    Parameters
    ----------
    changing : ndarray, shape (n, n_joints)
        What changes its level with each axis.
    """

    def __init__(self, system: Normal, changing: Array) -> None:
        self._system = system
        self._sides = system.N @ changing, system.v @ changing
        self._squares = np.swapaxes(self._sides[0], 1, 2) @ changing

    def error(self, spans: Sequence[int]) -> Array:
        """Squared errors on blocks that were held out, at the speeds that are fitted."""
        system, axes = self._system, np.repeat(np.arange(len(spans)), spans)
        hats = np.hstack([levels(len(system.v), k) for k in spans])
        beside = self._sides[0][:, :, axes] * hats[:, np.newaxis]
        corner = self._squares[:, axes[:, np.newaxis], axes]
        corner = corner * hats[:, :, np.newaxis] * hats[:, np.newaxis]
        N = np.block([[system.N, beside], [np.swapaxes(beside, 1, 2), corner]])
        v = np.hstack([system.v, self._sides[1][:, axes] * hats])
        whole = Normal(N, v, system.square)
        return HeldOut(whole, whole).error(np.arange(v.shape[1]))
