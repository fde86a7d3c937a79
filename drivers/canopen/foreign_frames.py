"""Detection of foreign frames that command our drives; they stop the axes.

Our own frames do not return to us. Hence a received NMT command (000h), SYNC (080h), RPDO (200h to
500h plus node) or SDO request (600h plus node) comes from another participant: a second master, a
configuration tool, a second producer of SYNC. Reading or starting nodes is only noted. A drive
whose supervision of our life sign is switched off by such a frame is set up again at once, since
its axis is under power until it has stopped; once only, or two such programs would never end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.objects import NMT, SYNC
from drivers.canopen.rules import WATCHDOGS
from drivers.drive_bus import Tripped

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from drivers.canopen.network import PumpedNetwork

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
_REMEDY = "nobody else may command these drives: end that master or tool first"


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
        """Watch the RPDOs of our drives: ours (identifier to node) and predefined, less `tpdos`."""
        for identifier in self._rpdos:
            self._network.unsubscribe(identifier, self._take_frame)
        usual = {base + node: node for node in self._labels for base in RPDOS}
        self._rpdos = {key: node for key, node in {**usual, **rpdos}.items() if key not in tpdos}
        for identifier in self._rpdos:
            self._network.subscribe(identifier, self._take_frame)

    def _take_frame(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del timestamp
        if can_id == SYNC:
            self._report("another producer sends SYNC (080h), so drives answer at other instants")
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
