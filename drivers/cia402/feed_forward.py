"""Feed-forward of velocity and torque (60B1, 60B2), sent with each set-point of a stream.

A drive adds the offsets to the commands of its loops until the next ones arrive, so that the loops
correct only the unforeseen. A drive with velocity feed-forward of its own would apply the velocity
twice: where the responsible object is known, it is set to zero during our feed-forward and restored
afterwards.

An offset acts until cancelled. Hence a path must end with zero, and any end of a stream cancels the
offsets on every axis (`drivers.cia402.shutdown` does so with each of its commands).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drivers.cia402.objects import own_feed_forward

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from drivers.axis import Axis
    from drivers.cycle_data import ProcessData
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary

    Array = NDArray[np.float64]


class FeedForward:
    """Feed-forward of the axes in a stream.

    Parameters
    ----------
    process_data : ProcessData
    axes : sequence of Axis
        Axes in joint order.

    Attributes
    ----------
    wanted : bool
        True if offsets are sent with each set-point.
    """

    def __init__(self, process_data: ProcessData, axes: Sequence[Axis]) -> None:
        self._process_data, self._axes = process_data, axes
        self.wanted = False
        self._found: list[tuple[RemoteDictionary, Entry, int]] = []

    def begin(self, *, feeding: bool) -> None:
        """Prepare for a path while the axes rest.

        Parameters
        ----------
        feeding : bool
            True if the path has feed-forward; otherwise the drives' own is restored.
        """
        self.wanted = feeding
        if not feeding:
            self.give_back()
        elif not self._found:
            # switch off the drives' own feed-forward, and remember its settings
            for axis in self._axes:
                for entry in own_feed_forward(axis.drive):
                    value = axis.server.find(entry)
                    if value:
                        self._found.append((axis.server, entry, value))
                        axis.server.put(entry, 0)

    def withdraw(self) -> None:
        """Send zero offsets to the axes if non-zero ones were sent."""
        if self.wanted:
            self.wanted = False
            for axis in self._axes:
                self._process_data.withdraw(axis.index)

    def give_back(self) -> None:
        """Restore the drives' own feed-forward."""
        while self._found:
            server, entry, value = self._found[-1]
            server.put(entry, value)
            self._found.pop()


def offsets_in_counts(fed: Sequence[Array], axes: Sequence[Axis]) -> Array:
    """Convert feed-forward to the drives' units, shape (n, n_axes, 3), not rounded.

    Parameters
    ----------
    fed : three ndarrays, shape (n, n_axes)
        Velocity, torque, and the part of the torque that holds the axes [rad/s or m/s, N m or N].
    axes : sequence of Axis
        Axes in joint order.
    """
    velocity, torque, holding = fed
    counts = [
        np.column_stack(
            [
                axis.scale.velocity_offset_to_counts(velocity[:, axis.index]),
                axis.scale.torque_offset_to_counts(torque[:, axis.index]),
                axis.scale.torque_offset_to_counts(holding[:, axis.index]),
            ]
        )
        for axis in axes
    ]
    return np.stack(counts, axis=1)
