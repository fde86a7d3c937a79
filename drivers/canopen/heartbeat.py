"""Heartbeats in both directions (CiA 301): supervision of the master and of the drives.

The drives stop their axes when our heartbeat ends (1016, 6007), as when this process dies. A drive
that cannot supervise a heartbeat is asked for its state at intervals instead, by a remote frame
with the identifier of its heartbeat (life guarding): requests accompany our heartbeat and end with
it, so that both kinds of drives stop alike. In the other direction, a node that falls silent,
restarts or leaves the state OPERATIONAL is a failure; only after NMT start is a delay allowed. Time
is that of SYNC's pacing, so in lock-step it does not advance between two SYNCs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import can

from drivers.drive_bus import NodeSilent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from drivers.canopen.network import PumpedNetwork
    from drivers.drive_bus import DriveError

START_TIME = 2.0
"""Longest time of a node from NMT start to OPERATIONAL [s]; CiA 301 states no bound."""

OPERATIONAL = 0x05
PRE_OPERATIONAL = 0x7F
_STATES = {
    0x00: "has restarted (boot-up)",
    0x04: "is stopped",
    PRE_OPERATIONAL: "is pre-operational",
}


class Heartbeats:
    """Heartbeats of the master and of the drives (`drivers.fieldbus.LifeSign`).

    Parameters
    ----------
    network : PumpedNetwork
        Network of the heartbeats.
    master : int
        Our node number.
    labels : mapping of int to str
        Node number to the drive's name in messages.
    period, timeout : float
        Period, and longest time without a heartbeat [s].
    now : callable
        Clock [s].

    Attributes
    ----------
    ceased : bool
        True if our heartbeat has ended.
    starting : set of int
        Nodes commanded to start that have not shown OPERATIONAL yet.
    requests : list of can.Message
        Guarding requests, sent with each heartbeat.
    """

    name = "our heartbeat"

    def __init__(
        self,
        network: PumpedNetwork,
        master: int,
        labels: Mapping[int, str],
        period: float,
        timeout: float,
        now: Callable[[], float],
    ) -> None:
        self.due = -math.inf
        self.ceased = False
        self._next_beat = -math.inf
        self.trouble: DriveError | None = None
        self.requests: list[can.Message] = []
        self._network = network
        self._frame = can.Message(
            arbitration_id=0x700 + master, data=[OPERATIONAL], is_extended_id=False
        )
        self._labels, self._period, self.timeout = labels, period, timeout
        self._now = now
        self._heard: dict[int, float] = {}
        self.starting: set[int] = set()
        self._start_ends = -math.inf
        for node in labels:
            network.subscribe(0x700 + node, self._take_heartbeat)
        network.subscribe(0x700 + master, self._take_foreign)

    def watch(self, *, starting: bool = False) -> None:
        """Start to supervise the drives' heartbeats, and resume ours if ceased.

        Parameters
        ----------
        starting : bool
            True after NMT start: drives may be pre-operational for `START_TIME`. Otherwise all are
            OPERATIONAL.
        """
        self.trouble, self.ceased = None, False
        self.starting = set(self._labels) if starting else set()
        self._heard = dict.fromkeys(self._labels, self._now())
        self._start_ends = self._now() + START_TIME

    def beat(self) -> None:
        """Send our heartbeat if due."""
        if self._now() >= self._next_beat and not self.ceased:
            self.hurry()

    def hurry(self) -> None:
        """Send our heartbeat now, unless ceased."""
        if self.ceased:
            return
        self._next_beat = self._now() + self._period
        self._network.send_frame(self._frame)
        for request in self.requests:
            self._network.send_frame(request)

    def cease(self) -> None:
        """Stop heartbeat and requests: drives under supervision of the master stop the axes."""
        self.ceased = True

    def service(self) -> None:
        """Send our heartbeat if due, and check the drives for overdue ones."""
        self.beat()
        now = self._now()
        last = min(self._heard.values(), default=math.inf)
        self.due = min(self._next_beat, last + self.timeout)
        if self.trouble is None and now - last >= self.timeout:
            node = min(self._heard, key=self._heard.__getitem__)
            self.trouble = NodeSilent(
                f"{self._labels[node]}: no heartbeat for {now - self._heard[node]:.3g} s (limit "
                f"{self.timeout:g} s); check the drive's supply and the CAN wiring"
            )

    def fail(self, trouble: DriveError) -> None:
        """Record that another participant commands a supervised drive."""
        if self._heard and self.trouble is None:
            self.trouble = trouble

    def _take_foreign(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Report another sender of our heartbeat: the drives would not notice our end."""
        del data, timestamp
        self.fail(
            NodeSilent(
                f"another master on the bus sends our heartbeat (node {can_id - 0x700}): the drives"
                " would go on when this process dies; end that master, or give each a master_node"
                " of its own in the drives file"
            )
        )

    def _take_heartbeat(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del timestamp
        node = can_id - 0x700
        if node not in self._heard or not data:
            return
        state = data[0] & 0x7F
        self._heard[node] = self._now()
        if state == OPERATIONAL:
            self.starting.discard(node)
            return
        waits = node in self.starting and self._now() <= self._start_ends
        if not (waits and state == PRE_OPERATIONAL) and self.trouble is None:
            what = _STATES.get(state, f"shows NMT state {state:02X}h")
            self.trouble = NodeSilent(
                f"{self._labels[node]}: {what} in the middle of operation; check the drive's "
                "supply and that no other master is on the bus"
            )


def guarding_request(node: int) -> can.Message:
    """Return the remote frame of a guarding request to a node."""
    return can.Message(
        arbitration_id=0x700 + node, is_remote_frame=True, is_extended_id=False, dlc=1
    )
