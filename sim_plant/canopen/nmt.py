"""Network management of one node (CiA 301): states, commands, boot-up.

The state says which services answer: SDO while pre-operational or operational, PDO while
operational, EMCY unless stopped. SYNC and heartbeats go on in every state.
"""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


class NmtState(enum.IntEnum):
    """States as the heartbeat reports them."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(enum.IntEnum):
    """Commands as a master sends them."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


_TARGETS = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
}


class NmtSlave:
    """State of one node.

    Parameters
    ----------
    node_id : int
    changed : callable
        Called with every new state that services must follow.
    reset : callable
        Resets the node, all of it or its communication only (argument False), ending in boot-up.
    """

    def __init__(
        self,
        node_id: int,
        changed: Callable[[NmtState], None],
        reset: Callable[[bool], None],
    ) -> None:
        self._node_id = node_id
        self._changed = changed
        self._reset = reset
        self.state = NmtState.INITIALISING

    def receive(self, data: bytes) -> None:
        """Take a command frame; one for another node or without meaning is ignored."""
        if len(data) != 2 or data[1] not in (0, self._node_id):
            return
        if data[0] in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
            self.enter(NmtState.INITIALISING)
            self._reset(data[0] == NmtCommand.RESET_NODE)
        elif data[0] in _TARGETS:
            self.enter(_TARGETS[NmtCommand(data[0])])

    def enter(self, state: NmtState) -> None:
        """Go to `state`."""
        if state is not self.state:
            self.state = state
            self._changed(state)
