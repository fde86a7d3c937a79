"""Where unknowns stand: those that all channels share come first, then those of each channel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices


@dataclass(frozen=True, slots=True)
class Layout:
    """Named unknowns.

    Attributes
    ----------
    shared : tuple of str
        Of all channels.
    own : tuple of str
        Of each channel alone, the same for all.
    channels : tuple of str
        Names of the channels, such as ``axis 2``.
    """

    shared: tuple[str, ...]
    own: tuple[str, ...]
    channels: tuple[str, ...]

    @property
    def n_channels(self) -> int:
        """How many channels there are."""
        return len(self.channels)

    @property
    def size(self) -> int:
        """How many unknowns there are."""
        return len(self.shared) + self.n_channels * len(self.own)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all unknowns; those of a channel begin with its name: ``axis 2 Coulomb``."""
        own = (f"{channel} {name}" for channel in self.channels for name in self.own)
        return (*self.shared, *own)

    def place(self, channel: int) -> Indices:
        """Places of the shared unknowns and of one channel's own, shape (n_shared + n_own,)."""
        return axis_place(len(self.shared), len(self.own), channel)

    def at(self, name: str, channel: int | None = None) -> int:
        """Place of one unknown."""
        if channel is None:
            return self.shared.index(name)
        return len(self.shared) + channel * len(self.own) + self.own.index(name)

    def kept(self, own: Sequence[Sequence[str]], shared: Sequence[str] | None = None) -> Indices:
        """Places of some unknowns: of each channel's own ones, and of all or some shared ones."""
        names = self.shared if shared is None else shared
        places = [self.at(name) for name in names]
        places += [self.at(name, k) for k, each in enumerate(own) for name in each]
        return np.array(sorted(places), dtype=np.intp)


def axis_names(n: int) -> tuple[str, ...]:
    """Names of channels that are axes, from 1."""
    return tuple(f"axis {axis + 1}" for axis in range(n))


def axis_place(n_shared: int, n_own: int, axis: int) -> Indices:
    """Places of the shared unknowns and of one axis's own among all, shape (n_shared + n_own,).

    Parameters
    ----------
    n_shared : int
        Unknowns that all axes share.
    n_own : int
        Unknowns of each axis alone.
    axis : int
        From 0.
    """
    first = n_shared + axis * n_own
    return np.concatenate([np.arange(n_shared), np.arange(first, first + n_own)])


def embedded(x: Array, kept: Indices, n: int) -> Array:
    """Kept unknowns among all `n`, the others zero.

    Parameters
    ----------
    x : ndarray, shape (n_kept,) or (n_kept, n_kept)
        Values of the kept unknowns, or a covariance of theirs.
    kept : ndarray of int, shape (n_kept,)

    Returns
    -------
    ndarray, shape (n,) or (n, n)
    """
    found = np.zeros((n,) * x.ndim)
    found[np.ix_(*[kept] * x.ndim)] = x
    return found
