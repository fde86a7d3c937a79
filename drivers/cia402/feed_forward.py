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

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from drivers.axis import AxisScale
    from drivers.fieldbus import Entry, Objects, ProcessData

    Array = NDArray[np.float64]


class FeedForward:
    """What is fed forward to all axes in a stream.

    Parameters
    ----------
    process_data : ProcessData
        Of all axes.
    servers : sequence of Objects
        The drives in joint order.
    own : sequence of sequence of Entry
        The objects of each drive's own feed-forward; none where unknown.

    Attributes
    ----------
    wanted : bool
        Offsets go out with each set-point.
    """

    def __init__(
        self,
        process_data: ProcessData,
        servers: Sequence[Objects],
        own: Sequence[Sequence[Entry]] = (),
    ) -> None:
        self._process_data = process_data
        self._servers = servers
        self._own = own or ((),) * len(servers)
        self.wanted = False
        self._found: list[tuple[Objects, Entry, int]] = []

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
            for axis in range(len(self._servers)):
                self._process_data.withdraw(axis)

    def give_back(self) -> None:
        """Let drives feed forward again by themselves as they were found to."""
        while self._found:
            server, entry, value = self._found[-1]
            server.put(entry, value)
            self._found.pop()

    def _take_over(self) -> None:
        for server, own in zip(self._servers, self._own, strict=True):
            for entry in own:
                value = server.find(entry)
                if value:
                    self._found.append((server, entry, value))
                    server.put(entry, 0)


def offsets_in_counts(fed: Sequence[Array], scales: Sequence[AxisScale]) -> Array:
    """Return offsets in the drives' units, shape (n, n_axes, 3), not rounded.

    Parameters
    ----------
    fed : three ndarrays, shape (n, n_axes)
        Velocity, torque, and the part of it that holds the axes [rad/s or m/s, N m or N].
    scales : sequence of AxisScale
        In joint order.
    """
    columns = zip(scales, *(values.T for values in fed), strict=True)
    counts = [
        np.column_stack(
            [scale.velocity_offset_to_counts(v), *map(scale.torque_offset_to_counts, (tau, held))]
        )
        for scale, v, tau, held in columns
    ]
    return np.stack(counts, axis=1)
