"""True events of a session in the plant: energised axes, watchdogs, distances.

Judged by the machine and by the drives' own dictionaries, never by the driver or by frames. The
buses of this package call `look` after every frame and every advance of time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim_plant.physics import state as st

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sim_plant.faults.faulty_network import FaultyNetwork

STILL = 1e-3
"""Speed below which an axis is at standstill [rad/s]."""


class Witness:
    """Observer of machine and dictionaries.

    Parameters
    ----------
    network : FaultyNetwork
        Observed network.
    reaction : float
        Time after the event in which no axis can be expected to be stopped [s].
    unnoticed : float
        Time for which a drive may be unwatched, since nobody can notice the change sooner [s].

    Attributes
    ----------
    energised : bool
        True if an axis was energised at any time.
    unwatched : set of int
        Axes, from 1, that were energised for longer than `unnoticed` while their drive would not
        have reacted to the loss of the master's heartbeat: 1016h names no node, or no heartbeat was
        received since 1016h was written.
    began : float or None
        Instant of the event [s].
    off_after : float or None
        Time from the event until no axis was energised or moving [s].
    ways : ndarray, shape (n_axes,)
        Largest distance of each axis from its position at the event [rad].
    speeds : ndarray, shape (n_axes,)
        Highest speed of each axis from the event until `reaction` is over [rad/s].
    """

    def __init__(
        self, network: FaultyNetwork, reaction: float = 0.0, unnoticed: float = 0.0
    ) -> None:
        self.energised = False
        self.unwatched: set[int] = set()
        self.began: float | None = None
        self.off_after: float | None = None
        self._network = network
        self._since: dict[int, float] = {}
        self._unnoticed = unnoticed
        self._reaction = reaction
        self._state: NDArray[np.float64] = network.machine.plant.state
        self.ways, self.speeds = np.zeros((2, len(self._state)))
        self._from = self.ways

    def begin(self) -> None:
        """Record the event at the present instant, in place of an earlier one."""
        self.began, self.off_after = self._network.time, None
        self._from = self._state[:, st.Q].copy()
        self.ways, self.speeds = np.zeros((2, len(self._state)))

    def look(self) -> None:
        """Observe the present state."""
        enabled = self._state[:, st.ENABLED] != 0.0
        if enabled.any():
            self.energised = True
            nodes = zip(self._network.nodes, enabled, strict=True)
            now = {axis for axis, (node, on) in enumerate(nodes, 1) if on and not node.is_watching}
            then = {axis: self._since.get(axis, self._network.time) for axis in now}
            self._since = then
            long_ago = self._network.time - self._unnoticed
            # with a tolerance of zero, one look is enough
            self.unwatched |= {a for a in now if not self._unnoticed or then[a] < long_ago}
        if self.began is not None:
            self._measure(self._network.time - self.began)

    def _measure(self, elapsed: float) -> None:
        q, speed = self._state[:, st.Q], np.abs(self._state[:, st.QD])
        np.maximum(self.ways, np.abs(q - self._from), out=self.ways)
        if elapsed <= self._reaction:
            np.maximum(self.speeds, speed, out=self.speeds)
        if self.off_after is None and self.all_off:
            self.off_after = elapsed

    @property
    def all_off(self) -> bool:
        """True if no axis is energised or moving."""
        state = self._state
        return not state[:, st.ENABLED].any() and bool(np.all(np.abs(state[:, st.QD]) < STILL))
