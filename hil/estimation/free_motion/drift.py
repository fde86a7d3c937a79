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

from hil.estimation.free_motion.friction_terms import BENT, COLUMNS
from hil.estimation.free_motion.scaling import recast
from hil.regression.choice import FOLDS, HeldOut, simplest
from hil.regression.normal_equations import Normal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice

    Array = NDArray[np.float64]

APART = 60.0
"""Of instants at which a level is found, at least [s]."""
SPANS = (0, 1, 2, 4, 6)
"""Between such instants, that are tried; held-out blocks must be shorter."""
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

    def applied(self, products: Products) -> Products:
        """Products with a shared column for each instant but the first of every axis that drifts.

        The columns are the last of the shared ones, axis after axis.
        """
        if not any(self.spans):
            return products
        own = slice(1 + products.n_shared, None)
        n_pieces, m = len(products.pieces), products.pieces.shape[-1]
        made = np.zeros((n_pieces, products.n_joints, m, sum(self.spans)))
        at = 0
        for axis, spans in enumerate(self.spans):
            hats = levels(n_pieces, spans)
            made[:, axis, own, at : at + spans] = (
                self.friction[axis][:, np.newaxis] * hats[:, np.newaxis]
            )
            at += spans
        first = np.zeros((products.n_joints, m))
        first[:, 0] = 1.0
        kept, ones = np.arange(1, 1 + products.n_shared), np.ones(products.n_joints)
        return recast(products, first, kept, made, ones)

    def found(self, x: Array, n_shared: int, n_pieces: int) -> tuple[Array, ...]:
        """Level of each axis at its instants, over the mean; empty where it stays.

        Parameters
        ----------
        x : ndarray, shape (n,)
            Solution with the columns of `applied`, of which there are `n_shared` shared ones.
        """
        at, each = n_shared - sum(self.spans), []
        for spans in self.spans:
            ends = np.linspace(0.0, 1.0, spans + 1)
            hats = _hats(ends, spans) - _hats(_middles(n_pieces), spans).mean(axis=0)
            each.append(1.0 + hats @ x[at : at + spans] if spans else np.zeros(0))
            at += spans
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
    folds = min(FOLDS, len(products.pieces))
    possible = [n for n in SPANS if n * APART <= duration and 2 * n <= folds]
    n, kept = products.n_joints, choice.kept(products.n_shared)
    system = choice.equations(products)
    x = system.solution(kept)
    changes = [term in CHANGES for term in COLUMNS]
    friction = np.where(changes, x[products.n_shared :].reshape(n, -1), 0.0)
    search, spans = _Search(system, kept, friction), [0] * n
    for axis in range(n if len(possible) > 1 else 0):
        tried = {str(k): search.error((*spans[:axis], k, *spans[axis + 1 :])) for k in possible}
        spans[axis] = int(simplest(tried, n))
    return Drift(tuple(spans), friction)


class _Search:
    """Equations of the friction as it is, to which those of its changes are added.

    Parameters
    ----------
    friction : ndarray, shape (n_joints, n_columns)
        What changes its level with each axis.
    """

    def __init__(self, system: Normal, kept: NDArray[np.intp], friction: Array) -> None:
        own = block_diag(*friction[:, :, np.newaxis])
        shared = np.zeros((system.v.shape[1] - len(own), len(friction)))
        changing = np.vstack([shared, own])[kept]
        self._system = system.only(kept)
        self._sides = self._system.N @ changing, self._system.v @ changing
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
