"""Inner products of torques in SI, from those of signals as they were recorded.

A recorded signal y_i of axis i is worth g_i y_i [N m or N]. Where the map leaves a gain g_i open it
is an unknown beside the others. The signal is what has noise, so it stays on the left,

    y_i = (A_i p + Qm_i + C_i c + F_i a_i) / g_i + e_i,

and products of model and gain on the right are linearised about the present solution, with the
relative change d_i of the gain as unknown (Gauss-Newton):

    g_i y_i - Qm_i = A_i p + C_i c + F_i a_i - d_i (A_i p + Qm_i + C_i c + F_i a_i)_present + e_i.

The column of d_i is what the model says, without the noise of the signal: with the signal itself as
a column that noise would make every gain too small. All columns are combinations of those that are
condensed already, and so are their inner products.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Scaling:
    """Gains of all axes, and the solution about which unknown ones are linearised.

    Attributes
    ----------
    gains : ndarray, shape (n_joints,)
        [N m or N for one unit of the signal]; 1 where it is recorded in SI.
    unknown : tuple of int
        Axes, from 0, whose gain is to be found.
    x : ndarray, shape (n,)
        Base parameters, coupled motors' friction, then all terms of each axis's friction.
    """

    gains: Array
    unknown: tuple[int, ...]
    x: Array

    @classmethod
    def known(cls, n_joints: int) -> Scaling:
        """All signals are in SI."""
        return cls(np.ones(n_joints), (), np.zeros(0))

    def applied(self, recorded: Products) -> Products:
        """Products of SI torque; unknown gains' changes are the last of the shared columns.

        Parameters
        ----------
        recorded : Products
            By `hil.estimation.free_motion.accumulation.recorded_products`.
        """
        rotor = recorded.n_shared
        first = self.signal(recorded)
        first[:, rotor] = -1.0
        kept = np.arange(1, rotor)
        return recast(recorded, first, kept, self.columns(recorded), self.gains)

    def signal(self, recorded: Products) -> Array:
        """The signal times its gain, as a combination of columns, shape (n_joints, m)."""
        found = np.zeros((recorded.n_joints, recorded.pieces.shape[-1]))
        found[:, 0] = self.gains
        return found

    def columns(self, recorded: Products) -> Array:
        """Columns of the unknown gains as combinations, shape (n_joints, m, n_unknown)."""
        n, m = recorded.n_joints, recorded.pieces.shape[-1]
        n_linear, n_own = recorded.n_shared - 1, m - 1 - recorded.n_shared
        found = np.zeros((n, m, len(self.unknown)))
        for k, axis in enumerate(self.unknown):
            own = self.x[n_linear + axis * n_own :][:n_own]
            found[axis, 1:, k] = -np.concatenate([self.x[:n_linear], [1.0], own])
        return found


def recast(products: Products, first: Array, kept: Indices, added: Array, gains: Array) -> Products:
    """Inner products of other shared columns, which are combinations of those that there are.

    Parameters
    ----------
    products : Products
    first : ndarray, shape (n_joints, m)
        What is to be explained, column 0 of the result.
    kept : ndarray of int
        Shared columns that stay, which come next.
    added : ndarray, shape (n_joints, m, n_added) or (n_pieces, n_joints, m, n_added)
        Shared columns that follow; then come those of each axis alone, as they are. Those that
        differ from piece to piece are 0 in cells, which have no time.
    gains : ndarray, shape (n_joints,)
        That the recorded torque is multiplied by.
    """
    own = np.arange(1 + products.n_shared, products.pieces.shape[-1])
    k = added.shape[-1]
    whole = _beside(first, added)
    of_cells = whole if added.ndim == 3 else _beside(first, np.zeros_like(added[0]))
    order = np.concatenate([[0], 1 + k + np.arange(len(kept)), 1 + np.arange(k),
                            1 + k + len(kept) + np.arange(len(own))])  # fmt: skip
    places = np.concatenate([kept, own])
    instruments = products.instruments
    return replace(
        products,
        pieces=_combined(products.pieces, whole[..., np.newaxis, :, :], places, order),
        cells=_combined(products.cells, of_cells[:, np.newaxis], places, order),
        instruments=None if instruments is None else _combined(instruments, whole, places, order),
        squares=gains**2 * products.squares,
        n_shared=len(kept) + k,
    )


def _beside(first: Array, added: Array) -> Array:
    """Combinations side by side, those of `first` in every piece."""
    shape = (*added.shape[:-1], 1)
    return np.concatenate([np.broadcast_to(first[..., np.newaxis], shape), added], axis=-1)


def _combined(P: Array, made: Array, kept: Indices, order: Sequence[int] | Indices) -> Array:
    """Products of the columns `made` of combinations and of `kept` ones, in another order."""
    right, left = P @ made, np.swapaxes(made, -1, -2) @ P
    some = P[..., kept[:, np.newaxis], kept]
    above = np.concatenate([np.swapaxes(made, -1, -2) @ right, left[..., kept]], axis=-1)
    below = np.concatenate([right[..., kept, :], some], axis=-1)
    whole: Array = np.concatenate([above, below], axis=-2)
    index = np.asarray(order)
    return whole[..., index[:, np.newaxis], index]
