"""Network management (NMT) of a node (CiA 301): states, commands, boot-up.

The state says which services answer: SDO while pre-operational or operational, PDO while
operational, EMCY unless stopped. SYNC and heartbeats continue in every state.
"""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.timers import Timers


class NmtState(enum.IntEnum):
    """NMT states, numbered as in the heartbeat."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(enum.IntEnum):
    """NMT commands, numbered as sent by the master."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


_STARTED = NmtState.OPERATIONAL
_TARGETS = {
    NmtCommand.START: _STARTED,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
}


class NmtSlave:
    """NMT state of a node.

    Parameters
    ----------
    node_id : int
    axis : int
        Number of the axis in the node, from 1.
    changed : callable
        Called with every new state that services must follow.
    reset : callable
        Resets the node, all of it or its communication only (argument False), ending in boot-up.
    timers : Timers
        Shared by all nodes of the bus.
    start_lag : float
        Time from NMT start to OPERATIONAL [s].
    """

    def __init__(
        self,
        node_id: int,
        axis: int,
        changed: Callable[[NmtState], None],
        reset: Callable[[bool], None],
        timers: Timers,
        start_lag: float = 0.0,
    ) -> None:
        self._node_id = node_id
        self._timers = timers
        self._start_lag = start_lag
        self._lagging = (node_id, axis, "NMT start")
        self._changed = changed
        self._reset = reset
        self.state = NmtState.INITIALISING

    def receive(self, data: bytes) -> None:
        """Receive a command frame; ignore commands for other nodes and unknown commands."""
        if len(data) != 2 or data[1] not in (0, self._node_id):
            return
        if data[0] == NmtCommand.START and self._start_lag and self.state is not _STARTED:
            if not self._timers.runs(self._lagging):
                self._timers.start(self._lagging, self._start_lag, lambda: self.enter(_STARTED))
            return
        self._timers.stop(self._lagging)
        if data[0] in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
            self.enter(NmtState.INITIALISING)
            self._reset(data[0] == NmtCommand.RESET_NODE)
        elif data[0] in _TARGETS:
            self.enter(_TARGETS[NmtCommand(data[0])])

    def enter(self, state: NmtState) -> None:
        """Enter `state`."""
        if state is not self.state:
            self.state = state
            self._changed(state)
