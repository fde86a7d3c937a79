"""Offsets of velocity and torque (60B1, 60B2) that go out with each set-point of a stream.

A drive adds them to the commands of its loops until the next ones come, so that its loops correct
what the master could not foresee, and nothing else. A drive that feeds the velocity of its demand
forward by itself would do so twice: where the object that rules this is known, it is set to zero as
long as we feed forward, and put back afterwards.

An offset that nobody takes back goes on pushing. So a path must end with zero, and whatever breaks
a stream off withdraws the offsets on every axis (`drivers.cia402.shutdown` does with each of its
commands).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drivers.cia402.vendor_objects import own_feed_forward

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from drivers.axis import Axis
    from drivers.cycle_data import ProcessData
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary

    Array = NDArray[np.float64]


class FeedForward:
    """What is fed forward to all axes in a stream.

    Parameters
    ----------
    process_data : ProcessData
        Of all axes.
    axes : sequence of Axis
        In joint order.

    Attributes
    ----------
    wanted : bool
        Offsets go out with each set-point.
    """

    def __init__(self, process_data: ProcessData, axes: Sequence[Axis]) -> None:
        self._process_data = process_data
        self._axes = axes
        self.wanted = False
        self._found: list[tuple[RemoteDictionary, Entry, int]] = []

    def begin(self, *, feeding: bool) -> None:
        """Get ready for a path that is about to begin, while the axes rest.

        Parameters
        ----------
        feeding : bool
            Something goes with it. If not it is left to the drives to feed forward.
        """
        self.wanted = feeding
        if not feeding:
            self.give_back()
        elif not self._found:
            self._take_over()

    def withdraw(self) -> None:
        """Send zero to all axes, if anything was sent."""
        if self.wanted:
            self.wanted = False
            for axis in self._axes:
                self._process_data.withdraw(axis.index)

    def give_back(self) -> None:
        """Let drives feed forward again by themselves as they were found to."""
        while self._found:
            server, entry, value = self._found[-1]
            server.put(entry, value)
            self._found.pop()

    def _take_over(self) -> None:
        for axis in self._axes:
            for entry in own_feed_forward(axis.drive):
                value = axis.server.find(entry)
                if value:
                    self._found.append((axis.server, entry, value))
                    axis.server.put(entry, 0)


def offsets_in_counts(fed: Sequence[Array], axes: Sequence[Axis]) -> Array:
    """Return offsets in the drives' units, shape (n, n_axes, 3), not rounded.

    Parameters
    ----------
    fed : three ndarrays, shape (n, n_axes)
        Velocity, torque, and the part of it that holds the axes [rad/s or m/s, N m or N].
    axes : sequence of Axis
        In joint order.
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
