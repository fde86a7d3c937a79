"""Orthonormal basis of the estimated columns, stored by channel.

The estimated columns Z consist of shared columns and of columns of one channel each, so a row of Z
has some 17 of 104 elements. With C of ``C C' = (Z'Z)^-1`` the basis is Q = Z C. Q itself has no
zeros: products with Q are computed from the nonzero part of Z and the rows of C of the channel, in
a sixth of the operations.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.excluded.dispersion import enlargement

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices, Mask


class Basis:
    """Orthonormal basis Q of the estimated columns, shape (n, rank).

    Parameters
    ----------
    rows : ndarray, shape (n, n_shared + n_own)
        Weighted columns: the shared ones, and those of the row's channel.
    channel : ndarray of int, shape (n,)
        Channel of each row.
    starts : ndarray of int, shape (n_groups,)
        First row of each group.
    places : sequence of ndarray of int
        Indices of the columns among all unknowns, by channel.
    coefficients : ndarray, shape (n_unknowns, rank)
        Inverse root of the information of all unknowns.
    """

    def __init__(
        self,
        rows: Array,
        channel: Indices,
        starts: Indices,
        places: Sequence[Indices],
        coefficients: Array,
    ) -> None:
        self._rows, self._channel, self._places = rows, channel, places
        self._coefficients = coefficients
        self._groups = _slices(starts, len(rows))
        edges = np.union1d(starts, np.flatnonzero(np.diff(channel)) + 1)
        self._runs = [(at, int(channel[at.start])) for at in _slices(edges, len(rows))]

    def unknowns(self, x: Array) -> Array:
        """Return the solution of the estimated columns for rows `x`, (Z'Z)^-1 Z'x."""
        side = np.zeros((len(self._coefficients), *x.shape[1:]))
        for at, channel in self._runs:
            side[self._places[channel]] += self._rows[at].T @ x[at]
        return np.asarray(self._coefficients @ (self._coefficients.T @ side))

    def project_out(self, x: Array) -> Array:
        """Return rows `x` less their part within the basis, x - QQ'x."""
        solution, left = self.unknowns(x), x.copy(order="K")
        for at, channel in self._runs:
            left[at] -= self._rows[at] @ solution[self._places[channel]]
        return left

    def some(self, mask: Mask) -> Array:
        """Return rows of Q."""
        found = np.empty((int(mask.sum()), self._coefficients.shape[1]))
        for channel, place in enumerate(self._places):
            own = self._channel[mask] == channel
            found[own] = self._rows[mask][own] @ self._coefficients[place]
        return found

    def enlarge(self, x: Array) -> Array:
        """Multiply rows `x` of each group k by (1 - Q_k Q_k')^(-1/2), shape (n,)."""
        found = x.copy()
        for at, (vectors, factor) in zip(self._groups, self._enlargements, strict=True):
            found[at] += vectors @ (factor * (vectors.T @ x[at]))
        return found

    @cached_property
    def _enlargements(self) -> list[tuple[Array, Array]]:
        """V and f of each group, with (1 - Q_k Q_k')^(-1/2) = 1 + V diag(f) V'."""
        found: list[tuple[Array, Array]] = []
        roots: dict[tuple[int, ...], Array] = {}
        for at in self._groups:
            channels = tuple(np.unique(self._channel[at]).tolist())
            place = np.unique([self._places[channel] for channel in channels])
            if channels not in roots:
                # Q_k Q_k' = Z_k C C' Z_k' = (Z_k R')(Z_k R')', with R of C' = U R
                _, upper = np.linalg.qr(self._coefficients[place].T)
                roots[channels] = upper.T
            Z = np.zeros((at.stop - at.start, len(place)))
            for channel in channels:
                own = np.flatnonzero(self._channel[at] == channel)
                columns = np.searchsorted(place, self._places[channel])
                Z[own[:, np.newaxis], columns] = self._rows[at][own]
            found.append(enlargement(Z @ roots[channels]))
        return found


def _slices(starts: Indices, n: int) -> list[slice]:
    return [slice(a, b) for a, b in pairwise([*starts.tolist(), n])]
