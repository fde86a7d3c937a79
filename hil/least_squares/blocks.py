"""Inner products of a torque and named columns: sufficient data for least squares.

A *group* is left out, held out or clustered as a whole: a measurement, a period, a pair of strokes,
a piece of time. A *channel* has a residual variance of its own: the torque of an axis. From the
samples of channel j in group k, with torque y and columns W, a block holds

    P_kj = [y W]'[y W].

Blocks are summed over groups. A change of columns needs no second pass over the samples,

    [y W] -> [y W] T    so    P -> T' P T,

as used for unknown gains, drifting levels and a load beside a known robot. Columns of a single
group are eliminated when its block is made (`hil.least_squares.solving`) by orthogonal projection
(Frisch, Waugh and Lovell). So recordings of any kind and rate form one regression: unknowns of
equal names are shared; an axis with its torque recorded in two ways has two channels.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.layout import Layout, axis_names
from hil.least_squares.normal_equations import Normal, successive

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hil.arrays import Array, Indices, Mask


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Inner products by group and channel.

    Attributes
    ----------
    shared, own : tuple of str
        Columns of unknowns shared by the channels, then columns of each channel alone.
    products : ndarray, shape (n_groups, n_channels, m, m)
        Inner products of the torque, the shared and the own columns, in this order.
    counts : ndarray, shape (n_groups, n_channels)
        Samples, less eliminated coefficients.
    channels : tuple of str
        Names of the channels; by default those of axes.
    labels : mapping of str to ndarray of int, shape (n_groups,)
        Labels of the groups, such as the recording.
    owners : mapping of str to str
        Owner of a channel's own unknowns, if different from the channel: the axis, if half-sums and
        half-differences of one torque are two channels.
    """

    shared: tuple[str, ...]
    own: tuple[str, ...]
    products: Array
    counts: Array
    channels: tuple[str, ...] = ()
    labels: Mapping[str, Indices] = field(default_factory=dict)
    owners: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.channels:
            object.__setattr__(self, "channels", axis_names(self.products.shape[1]))

    def __len__(self) -> int:
        return len(self.products)

    @property
    def n_channels(self) -> int:
        """Number of channels."""
        return int(self.products.shape[1])

    @property
    def layout(self) -> Layout:
        """Layout of the columns' unknowns."""
        owners = (self.owners.get(name, name) for name in self.channels)
        return Layout(self.shared, self.own, tuple(dict.fromkeys(owners)))

    @property
    def owner(self) -> Indices:
        """Index of the layout channel with the own unknowns of a channel, shape (n_channels,)."""
        among = self.layout.channels
        return np.array([among.index(self.owners.get(name, name)) for name in self.channels])

    @property
    def squares(self) -> Array:
        """Squares of the torque summed over groups, shape (n_channels,)."""
        found: Array = self.products[:, :, 0, 0].sum(axis=0)
        return found

    def place(self, *names: str) -> Indices:
        """Return the indices of columns in the products."""
        order = (*self.shared, *self.own)
        return np.array([1 + order.index(name) for name in names], dtype=np.intp)

    def where(self, mask: Mask | slice) -> Blocks:
        """Select groups by a mask or, without a copy, by a slice."""
        labels = {name: label[mask] for name, label in self.labels.items()}
        return replace(self, products=self.products[mask], counts=self.counts[mask], labels=labels)

    def merged(self, label: Indices) -> Blocks:
        """Sum groups of equal label, shape (n_groups,)."""
        _, first, of = np.unique(label, return_index=True, return_inverse=True)
        products, counts = self.products, self.counts
        if np.any(np.diff(of) < 0):
            order = np.argsort(of, kind="stable")
            products, counts, of = products[order], counts[order], of[order]
        begins = np.searchsorted(of, np.arange(len(first)))
        products = np.add.reduceat(products, begins, axis=0)
        counts = np.add.reduceat(counts, begins, axis=0)
        labels = {name: each[first] for name, each in self.labels.items()}
        return replace(self, products=products, counts=counts, labels=labels)

    def grouped(self, most: int) -> Blocks:
        """Sum successive groups into at most `most` larger groups."""
        label = np.zeros(len(self), dtype=np.intp)
        for number, part in enumerate(successive(0, len(self), min(most, len(self)))):
            label[part] = number
        return self.merged(label)

    @property
    def total(self) -> Blocks:
        """Sum of the groups as a single group."""
        products, counts = (x.sum(axis=0, keepdims=True) for x in (self.products, self.counts))
        labels = {name: label[:1] for name, label in self.labels.items()}
        return replace(self, products=products, counts=counts, labels=labels)

    def joined(self, *others: Blocks) -> Blocks:
        """Concatenate groups; missing columns and channels are zero."""
        every = (self, *others)
        shared, own, channels = (
            tuple(dict.fromkeys(name for each in every for name in getattr(each, kind)))
            for kind in ("shared", "own", "channels")
        )
        parts = [each.expanded(shared, own, channels) for each in every]
        labels = {
            name: np.concatenate([each.labels[name] for each in every])
            for name in self.labels
            if all(name in each.labels for each in every)
        }
        products, counts = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("products", "counts")
        )
        owners = {name: of for each in every for name, of in each.owners.items()}
        return Blocks(shared, own, products, counts, channels, labels, owners)

    def expanded(
        self, shared: tuple[str, ...], own: tuple[str, ...], channels: tuple[str, ...]
    ) -> Blocks:
        """Extend to more columns and channels, filled with zeros."""
        order = (*shared, *own)
        at = np.array([0, *(1 + order.index(name) for name in (*self.shared, *self.own))])
        of = np.array([channels.index(name) for name in self.channels])
        products = np.zeros((len(self), len(channels), 1 + len(order), 1 + len(order)))
        counts = np.zeros((len(self), len(channels)))
        products[:, of[:, None, None], at[:, None], at] = self.products
        counts[:, of] = self.counts
        return Blocks(shared, own, products, counts, channels, self.labels, self.owners)

    def only(self, shared: Sequence[str], own: Sequence[str]) -> Blocks:
        """Select columns, in the given order."""
        at = np.concatenate([[0], self.place(*shared, *own)]).astype(np.intp)
        products = self.products[:, :, at[:, np.newaxis], at]
        return replace(self, shared=tuple(shared), own=tuple(own), products=products)

    def drop(self, *names: str) -> Blocks:
        """Remove columns by name."""
        shared, own = (
            [name for name in names_of if name not in names] for names_of in (self.shared, self.own)
        )
        return self.only(shared, own)

    def combined(self, T: Array, shared: Sequence[str], own: Sequence[str]) -> Blocks:
        """Compute the blocks of linear combinations of the columns.

        Parameters
        ----------
        T : ndarray, shape (..., m, 1 + n_shared + n_own)
            Torque, shared and own columns as combinations of the columns of `products`; leading
            dimensions may be groups and channels.
        """
        products = np.swapaxes(T, -1, -2) @ self.products @ T
        return replace(self, shared=tuple(shared), own=tuple(own), products=products)

    def recast(
        self,
        torque: Array | None = None,
        added: Mapping[str, Array] | None = None,
        dropped: Sequence[str] = (),
    ) -> Blocks:
        """Replace the torque or shared columns; prefer `combined` if few columns stay.

        Parameters
        ----------
        torque : ndarray, shape (n_channels, m), optional
            Dependent variable, as a combination of the columns of `products`; by default the
            torque.
        added : mapping of str to ndarray, shape (n_channels, m) or (n_groups, n_channels, m)
            Shared columns to be appended, as combinations of the columns of `products`.
        dropped : sequence of str
            Shared columns to be removed.
        """
        m, new = self.products.shape[-1], added or {}
        first = np.eye(1, m) if torque is None else torque
        lead = np.broadcast_shapes(self.products.shape[:2], *(x.shape[:-1] for x in new.values()))
        made = np.stack([np.broadcast_to(x, (*lead, m)) for x in (first, *new.values())], axis=-1)
        stay = tuple(name for name in self.shared if name not in dropped)
        kept, k = self.place(*stay, *self.own), len(stay)
        # positions in the result: new columns first and after the shared ones, kept columns
        # elsewhere
        n_made, size = made.shape[-1], made.shape[-1] + len(kept)
        at = np.concatenate([[0], np.arange(1 + k, k + n_made)])
        place = np.setdiff1d(np.arange(size), at)
        products = np.empty((*lead, size, size))
        right, left = self.products @ made, np.swapaxes(made, -1, -2) @ self.products
        products[..., at[:, None], at] = np.swapaxes(made, -1, -2) @ right
        for to, of in _runs(place, kept):
            products[..., to, at], products[..., at, to] = right[..., of, :], left[..., of]
            for beside, other in _runs(place, kept):
                products[..., to, beside] = self.products[..., of, other]
        return replace(self, shared=(*stay, *new), products=products)

    def normal(self, weights: Array) -> Normal:
        """Compute the groups' normal equations for channel `weights`."""
        layout = self.layout
        n, k, n_own = layout.size, len(self.shared), len(self.own)
        N, v = np.zeros((len(self), n, n)), np.zeros((len(self), n))
        for channel, owner in enumerate(self.owner.tolist()):
            part = Normal.split(weights[channel] * self.products[:, channel])
            own = slice(k + owner * n_own, k + (owner + 1) * n_own)
            N[:, :k, :k] += part.N[:, :k, :k]
            N[:, :k, own] += part.N[:, :k, k:]
            N[:, own, :k] += part.N[:, k:, :k]
            N[:, own, own] += part.N[:, k:, k:]
            v[:, :k] += part.v[:, :k]
            v[:, own] += part.v[:, k:]
        return Normal(N, v, self.products[:, :, 0, 0] @ weights)

    def squares_left(self, x: Array) -> Array:
        """Compute squared residuals of a solution `x`, shape (n_groups, n_channels)."""
        left, layout = np.zeros(self.counts.shape), self.layout
        for channel, owner in enumerate(self.owner.tolist()):
            around = np.concatenate([[1.0], -x[layout.place(owner)]])
            left[:, channel] = (self.products[:, channel] @ around) @ around
        return np.maximum(left, 0.0)

    def mean_squares(self, x: Array) -> Array:
        """Compute the mean squared residual of `x` per channel, over the groups."""
        found: Array = self.total.squares_left(x)[0] / np.maximum(self.counts.sum(axis=0), 1.0)
        return found


def _runs(to: Indices, of: Indices) -> list[tuple[slice, slice]]:
    """Return runs of indices and their sources as slices, for fast copies."""
    ends = np.flatnonzero((np.diff(to) != 1) | (np.diff(of) != 1)) + 1
    first, last = np.append(0, ends), np.append(ends, len(to))
    pairs = zip(first.tolist(), last.tolist(), strict=True)
    return [(slice(to[a], to[b - 1] + 1), slice(of[a], of[b - 1] + 1)) for a, b in pairs if b > a]
