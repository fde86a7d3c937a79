"""Drift of the friction level during the recordings, axis by axis.

Friction falls while gears warm up and lubricant is stirred. In recordings of some minutes the drift
shows: the level of an axis's friction is then

    F(q, qd, t) = F(q, qd) (1 + sum d_k h_k(t)),

linear between instants spread evenly over the recorded time, with mean 0 over all pieces. F is the
friction law fitted to the whole recording, without offset and ripple, so that the problem is linear
in d_k. The number of instants, possibly none, is chosen like a law: the fewest with predictions of
held-out blocks as good as the best, friction being interpolated over the held-out blocks. A
constant level is never replaced by a drifting one with worse predictions. Instants are no closer
than `APART`: over shorter times the level would follow the motion.

Cells of states have no time: the drifting friction is subtracted from their torque. Otherwise each
cell would show the level at the few times of its samples as an error of the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

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
"""Shortest time between instants of the friction level [s]."""
SPANS = (0, 1, 2, 4, 6)
"""Candidate numbers of spans between instants; held-out blocks must be shorter."""
CHANGES = ("Coulomb", "viscous", "cube root", "arc tangent", "quadratic", "load", BENT)
"""Terms scaled by the friction level."""


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """Columns of drifting friction levels.

    Attributes
    ----------
    spans : tuple of int
        Number of spans of each axis; 0 for a constant level.
    friction : ndarray, shape (n_joints, n_columns)
        Coefficients of the drifting terms.
    """

    spans: tuple[int, ...]
    friction: Array

    @classmethod
    def none(cls, n_joints: int) -> Drift:
        """Create constant levels."""
        return cls((0,) * n_joints, np.zeros((n_joints, len(COLUMNS))))

    def names(self, axis: int) -> list[str]:
        """Return the unknown levels of an axis at every instant but the first."""
        return [f"level {axis + 1} at {k}" for k in range(1, self.spans[axis] + 1)]

    def applied(self, products: Products) -> Products:
        """Return products with shared columns of the levels of the drifting axes.

        Each instant but the first has a column. The columns are the last shared columns, axis after
        axis.
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

    def beyond_mean(self, x: Array, layout: Layout, n_pieces: int) -> Array:
        """Return the friction beyond that of mean level, shape (n_pieces, n_joints, n_columns).

        Parameters are those of `found`.
        """
        change = [
            levels(n_pieces, spans) @ x[[layout.index(name) for name in self.names(axis)]]
            for axis, spans in enumerate(self.spans)
        ]
        return np.transpose(change)[..., np.newaxis] * self.friction

    def found(self, x: Array, layout: Layout, n_pieces: int) -> tuple[Array, ...]:
        """Return the relative levels of every axis at the instants; empty for constant levels.

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
    """Return level changes by piece for a unit change at every instant but the first.

    Shape (n_pieces, spans); the mean over the pieces is 0.
    """
    found = _hats(_middles(n_pieces), spans)
    return np.asarray(found - found.mean(axis=0))


def _middles(n_pieces: int) -> Array:
    return np.asarray((np.arange(n_pieces) + 0.5) / n_pieces)


def _hats(share: Array, spans: int) -> Array:
    """Return hat functions of the instants but the first: 1 at an instant, linear between."""
    away = share[:, np.newaxis] * spans - np.arange(1, spans + 1)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(away)))


def find_drift(products: Products, choice: Choice, duration: float) -> Drift:
    """Find the axes with drifting friction, and the numbers of spans.

    Parameters
    ----------
    duration : float
        Total duration of the recordings [s].
    """
    folds = min(FOLDS, products.n_pieces)
    possible = [n for n in SPANS if n * APART <= duration and 2 * n <= folds]
    n, changes = products.n_joints, [term in CHANGES for term in COLUMNS]
    if len(possible) <= 1:
        return Drift.none(n)
    from scipy.linalg import block_diag  # noqa: PLC0415 - takes long to load

    fitted = choice.fitted(products)
    own = fitted.solution[len(fitted.layout.shared) :].reshape(n, -1)
    # d_k scales the friction F of constant level, so that the problem is linear in d_k
    friction = np.where(changes, own, 0.0)
    shared = np.zeros((len(fitted.layout.shared), n))
    changing = np.vstack([shared, block_diag(*friction[:, :, np.newaxis])])[fitted.kept]
    system, spans = fitted.normal, [0] * n
    sides = system.N @ changing, system.v @ changing
    squares = np.swapaxes(sides[0], 1, 2) @ changing

    def error(spans: Sequence[int]) -> Array:
        """Return squared errors on held-out blocks at the fitted speeds, with drifting levels."""
        axes = np.repeat(np.arange(n), spans)
        hats = np.hstack([levels(len(system.v), k) for k in spans])
        beside = sides[0][:, :, axes] * hats[:, np.newaxis]
        corner = squares[:, axes[:, np.newaxis], axes]
        corner = corner * hats[:, :, np.newaxis] * hats[:, np.newaxis]
        N = np.block([[system.N, beside], [np.swapaxes(beside, 1, 2), corner]])
        v = np.hstack([system.v, sides[1][:, axes] * hats])
        whole = Normal(N, v, system.square)
        return HeldOut(whole, whole).error(np.arange(v.shape[1]))

    for axis in range(n):
        tried = {str(k): error((*spans[:axis], k, *spans[axis + 1 :])) for k in possible}
        spans[axis] = int(simplest(tried, n))
    return Drift(tuple(spans), friction)
