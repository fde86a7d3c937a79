"""Frames of other participants that command our drives: whoever sends them, the axes are stopped.

Our own frames do not come back to us. So an NMT command (000h), a SYNC (080h), an RPDO (200h to
500h plus node) or an SDO request (600h plus node) that is received is somebody else's: a second
master, a configuration tool, a second producer of SYNC. What only reads or starts nodes is noted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.objects import NMT, SYNC
from drivers.drive_bus import Tripped

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

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
_WRITES = frozenset({1, 6})
"""Command specifiers of SDO requests that begin to write: download, block download."""
_READS = frozenset({2, 5})
_REMEDY = "nobody else may command these drives: end that master or tool first"


class ForeignFrames:
    """Hears what others send to our drives.

    Parameters
    ----------
    network : PumpedNetwork
        Where they are heard.
    labels : mapping of int to str
        Node number to how messages name the drive.
    command : callable
        Takes an error for each frame that commands a drive.
    """

    def __init__(
        self,
        network: PumpedNetwork,
        labels: Mapping[int, str],
        command: Callable[[Tripped], None],
    ) -> None:
        self._network, self._labels, self._command = network, labels, command
        self.remarks: list[str] = []
        self._rpdos: dict[int, int] = {}
        network.subscribe(NMT, self._on_nmt)
        network.subscribe(SYNC, self._on_sync)
        for node in labels:
            network.subscribe(SDO_REQUEST + node, self._on_sdo)

    def wire(self, rpdos: Mapping[int, int], tpdos: Sequence[int]) -> None:
        """Expect no other RPDOs, by identifier the node, than ours; what `tpdos` use is theirs."""
        for identifier in self._rpdos:
            self._network.unsubscribe(identifier, self._on_rpdo)
        usual = {base + node: node for node in self._labels for base in RPDOS}
        found = {**usual, **rpdos}
        self._rpdos = {key: node for key, node in found.items() if key not in tpdos}
        for identifier in self._rpdos:
            self._network.subscribe(identifier, self._on_rpdo)

    def _on_nmt(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del can_id, timestamp
        if len(data) < 2 or data[1] not in {0, *self._labels}:
            return
        whom = self._labels.get(data[1], "all nodes")
        what = f"another master commands {whom} {_NMT.get(data[0], f'by {data[0]:02X}h')} (NMT)"
        self._take(what, harmless=data[0] == 1)

    def _on_sync(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del can_id, data, timestamp
        self._take("another producer sends SYNC (080h), so drives answer at instants of its own")

    def _on_rpdo(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del timestamp
        label = self._labels[self._rpdos[can_id]]
        self._take(f"another master commands {label} by RPDO {can_id:03X}h, {data.hex(' ')}")

    def _on_sdo(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del timestamp
        command = data[0] >> 5 if len(data) > 3 else 0
        if command not in _WRITES | _READS:
            return None
        index, label = data[1] | data[2] << 8, self._labels[can_id - SDO_REQUEST]
        place = f"{index:04X}:{data[3]:02X} of {label}"
        if command in _READS:
            return self._take(f"another master or tool reads objects of {label}", harmless=True)
        value = int.from_bytes(data[4:8], "little") if data[0] & 2 else None
        shown = "" if value is None or command != 1 else f" = {value:X}h"
        return self._take(f"another master or tool writes {place}{shown} (SDO)")

    def _take(self, what: str, *, harmless: bool = False) -> None:
        message = f"{what}; {_REMEDY}"
        if not harmless:
            self._command(Tripped(message))
        elif message not in self.remarks:
            self.remarks.append(message)
