"""Supervision of master and drives by heartbeats (CiA 301), and detection of foreign masters.

The drives stop their axes when our heartbeat ends (1016, 6007), as when this process dies. A drive
that cannot supervise a heartbeat is asked for its state at intervals instead, by a remote frame
with the identifier of its heartbeat (life guarding): requests accompany our heartbeat and end with
it, so that both kinds of drives stop alike. In the other direction, a node that falls silent,
restarts or leaves the state OPERATIONAL is a failure; only after NMT start is a delay allowed. Time
is that of SYNC's pacing, so in lock-step it does not advance between two SYNCs.

Foreign frames that command our drives stop the axes. Our own frames do not return to us. Hence a
received NMT command (000h), SYNC (080h), RPDO (200h to 500h plus node) or SDO request (600h plus
node) comes from another participant: a second master, a configuration tool, a second producer of
SYNC. Reading or starting nodes is only noted. If a foreign frame switches off a drive's supervision
of our life sign, the drive is set up again at once, since its axis is under power until it has
stopped; once only, or two programs that do so would never end.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import can

from drivers.canopen.objects import NMT, SYNC
from drivers.canopen.rules import WATCHDOGS
from drivers.drive_bus import NodeSilent, Tripped

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from drivers.canopen.network import PumpedNetwork
    from drivers.drive_bus import DriveError

RPDOS = (0x200, 0x300, 0x400, 0x500)
SDO_REQUEST = 0x600
_NMT = {
    1: "to start",
    2: "to stop",
    128: "to go pre-operational",
    129: "to restart",
    130: "to restart its communication",
}
_RESETS = frozenset({129, 130})
_WRITES = frozenset({1, 6})
"""Command specifiers of SDO requests that start a download or block download."""
_READS = frozenset({2, 5})
_REMEDY = "only one master may command these drives: stop the other master or tool first"


class ForeignFrames:
    """Receiver of other participants' frames to our drives.

    Parameters
    ----------
    network : PumpedNetwork
        Network of the frames.
    labels : mapping of int to str
        Node number to the drive's name in messages.
    command : callable
        Receives an error for each frame that commands a drive.
    watch_again : callable
        Restores the supervision of our life sign in a node.
    """

    def __init__(
        self,
        network: PumpedNetwork,
        labels: Mapping[int, str],
        command: Callable[[Tripped], None],
        watch_again: Callable[[int], None],
    ) -> None:
        self._network, self._labels, self._command = network, labels, command
        self._watch_again, self._watching = watch_again, set(labels)
        self.remarks: list[str] = []
        self._rpdos: dict[int, int] = {}
        for identifier in (NMT, SYNC, *(SDO_REQUEST + node for node in labels)):
            network.subscribe(identifier, self._take_frame)

    def wire(self, rpdos: Mapping[int, int], tpdos: Sequence[int]) -> None:
        """Watch the drives' RPDOs: `rpdos` (identifier to node) and predefined, except `tpdos`."""
        for identifier in self._rpdos:
            self._network.unsubscribe(identifier, self._take_frame)
        usual = {base + node: node for node in self._labels for base in RPDOS}
        self._rpdos = {key: node for key, node in {**usual, **rpdos}.items() if key not in tpdos}
        for identifier in self._rpdos:
            self._network.subscribe(identifier, self._take_frame)

    def _take_frame(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del timestamp
        if can_id == SYNC:
            self._report("another producer sends SYNC (080h), so drives answer at wrong times")
        elif can_id == NMT and len(data) > 1 and data[1] in {0, *self._labels}:
            whom = self._labels.get(data[1], "all nodes")
            what = _NMT.get(data[0], f"by {data[0]:02X}h")
            self._report(f"another master commands {whom} {what} (NMT)", harmless=data[0] == 1)
            if data[0] in _RESETS:
                self._guard(self._labels if data[1] == 0 else (data[1],))
        elif can_id in self._rpdos:
            label = self._labels[self._rpdos[can_id]]
            self._report(f"another master commands {label} by RPDO {can_id:03X}h, {data.hex(' ')}")
        elif can_id > SDO_REQUEST and len(data) > 3:
            self._judge_request(can_id - SDO_REQUEST, data)

    def _judge_request(self, node: int, data: bytearray) -> None:
        command, label, who = data[0] >> 5, self._labels[node], "another master or tool"
        if command in _READS:
            self._report(f"{who} reads objects of {label}", harmless=True)
        elif command in _WRITES:
            index = data[1] | data[2] << 8
            place = f"{index:04X}:{data[3]:02X}"
            expedited = command == 1 and data[0] & 2
            value = f" = {int.from_bytes(data[4:8], 'little'):X}h" if expedited else ""
            self._report(f"{who} writes {place} of {label}{value} (SDO)")
            if index in WATCHDOGS:
                self._guard((node,))

    def _guard(self, nodes: Iterable[int]) -> None:
        for node in self._watching.intersection(nodes):
            self._watching.discard(node)
            self._watch_again(node)

    def _report(self, what: str, *, harmless: bool = False) -> None:
        message = f"{what}; {_REMEDY}"
        if not harmless:
            self._command(Tripped(message))
        elif message not in self.remarks:
            self.remarks.append(message)


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
                f"another master on the bus sends our heartbeat (node {can_id - 0x700}): the "
                "drives would keep moving after a crash of this process; stop that master, or "
                "give each a master_node of its own in the drives file"
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
                f"{self._labels[node]}: {what} during operation; check the drive's supply and "
                "that no other master is on the bus"
            )


def guarding_request(node: int) -> can.Message:
    """Return the remote frame of a guarding request to a node."""
    return can.Message(
        arbitration_id=0x700 + node, is_remote_frame=True, is_extended_id=False, dlc=1
    )
