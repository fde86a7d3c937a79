"""Layout of unknowns: shared unknowns first, then the own unknowns of every channel."""

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
        Names of unknowns shared by all channels.
    own : tuple of str
        Names of each channel's own unknowns.
    channels : tuple of str
        Names of the channels, such as ``axis 2``.
    """

    shared: tuple[str, ...]
    own: tuple[str, ...]
    channels: tuple[str, ...]

    @property
    def n_channels(self) -> int:
        """Number of channels."""
        return len(self.channels)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.shared) + self.n_channels * len(self.own)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns, own ones prefixed by the channel: ``axis 2 Coulomb``."""
        own = (f"{channel} {name}" for channel in self.channels for name in self.own)
        return (*self.shared, *own)

    def place(self, channel: int) -> Indices:
        """Return indices of the shared and a channel's own unknowns, shape (n_shared + n_own,)."""
        return axis_place(len(self.shared), len(self.own), channel)

    def index(self, name: str, channel: int | None = None) -> int:
        """Return the index of an unknown."""
        if channel is None:
            return self.shared.index(name)
        return len(self.shared) + channel * len(self.own) + self.own.index(name)

    def kept(self, own: Sequence[Sequence[str]], shared: Sequence[str] | None = None) -> Indices:
        """Return the indices of unknowns selected by channel and name."""
        names = self.shared if shared is None else shared
        places = [self.index(name) for name in names]
        places += [self.index(name, k) for k, each in enumerate(own) for name in each]
        return np.array(sorted(places), dtype=np.intp)


def axis_names(n: int) -> tuple[str, ...]:
    """Return channel names of `n` axes, from 1."""
    return tuple(f"axis {axis + 1}" for axis in range(n))


def axis_place(n_shared: int, n_own: int, axis: int) -> Indices:
    """Return the indices of the shared and an axis's own unknowns, shape (n_shared + n_own,).

    Parameters
    ----------
    n_shared : int
        Number of unknowns shared by all axes.
    n_own : int
        Number of own unknowns per axis.
    axis : int
        Index from 0.
    """
    first = n_shared + axis * n_own
    return np.concatenate([np.arange(n_shared), np.arange(first, first + n_own)])


def embedded(x: Array, kept: Indices, n: int) -> Array:
    """Embed kept unknowns in a vector or matrix of `n` unknowns, zero elsewhere.

    Parameters
    ----------
    x : ndarray, shape (n_kept,) or (n_kept, n_kept)
        Values or covariance of the kept unknowns.
    kept : ndarray of int, shape (n_kept,)

    Returns
    -------
    ndarray, shape (n,) or (n, n)
    """
    found = np.zeros((n,) * x.ndim)
    found[np.ix_(*[kept] * x.ndim)] = x
    return found
