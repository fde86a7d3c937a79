"""Independent drive on an independent bus: canopen's LocalNode on a stock virtual bus.

The drive runs in canopen's notifier thread, with a dictionary from an EDS and with canopen's PDOs
and SDO server; this module adds a minimal profile position mode of CiA 402. Each SYNC advances the
time by the period in 1006h. Only the EDS is shared with the plant.
"""

from __future__ import annotations

import math
import struct
from typing import Any

import canopen

SYNC, HEARTBEAT = 0x80, 0x700
ON_SYNC, OFF = 240, 1 << 31
STATES = {"off": 0x40, "ready": 0x21, "on": 0x23, "enabled": 0x27, "stopping": 0x07}
WAYS = {
    0x06: {"off": "ready", "on": "ready", "enabled": "ready"},
    0x07: {"ready": "on", "enabled": "on"},
    0x0F: {"ready": "enabled", "on": "enabled"},
}
FRICTION = 40
"""Current while moving, along the motion [per mille of rated current]."""


class _Task:
    """Replacement for canopen's heartbeat by the wall clock."""

    def __init__(self, *_: Any) -> None:
        pass

    def stop(self) -> None:
        pass

    def update(self, data: bytes) -> None:
        pass


class _Network(canopen.Network):
    NOTIFIER_CYCLE = 0.02

    def send_periodic(self, *arguments: Any, **_: Any) -> Any:
        return _Task(*arguments)


class ForeignDrive:
    """Independent CiA 402 drive; `position` and `velocity` in increments, increments/s."""

    def __init__(self, channel: str, node: int, eds: str, ratings: dict[tuple[int, int], int]):
        self.state = "off"
        self.position = self.velocity = 0.0
        self.target = 0.0
        self.acknowledged = False
        self.history = ["off"]
        self._word = 0
        self._since_beat = 0.0
        self._network = _Network()
        self._node = self._network.add_node(canopen.LocalNode(node, eds))
        for (index, subindex), value in ratings.items():
            entry = self._node.object_dictionary.get_variable(index, subindex)
            self._node.set_data(index, subindex, entry.encode_raw(value))
        self._node.add_read_callback(self._show)
        self._node.add_write_callback(self._take)
        self._network.subscribe(SYNC, self._handle_sync)
        for pdo in range(1, 5):
            self._network.subscribe(0x100 + 0x100 * pdo + node, self._handle_rpdo)
        self._network.connect(interface="virtual", channel=channel)

    def shutdown(self) -> None:
        """Leave the bus."""
        self._network.disconnect()

    def value(self, index: int, subindex: int = 0) -> int:
        """Return the present value of an object."""
        entry = self._node.object_dictionary.get_variable(index, subindex)
        return int(entry.decode_raw(self._node.get_data(index, subindex)))

    # The bus

    def _handle_sync(self, *_: Any) -> None:
        period = self.value(0x1006) * 1e-6
        self._move(period)
        self._beat(period)
        if self._node.nmt.state == "OPERATIONAL":
            for number in range(4):
                cob_id = self.value(0x1800 + number, 1)
                if not cob_id & OFF and self.value(0x1800 + number, 2) <= ON_SYNC:
                    data = b"".join(
                        self._node.get_data(*at) for at in self._mapped(0x1A00 + number)
                    )
                    self._network.send_message(cob_id & 0x7FF, data)

    def _handle_rpdo(self, can_id: int, data: bytearray, _: float) -> None:
        for number in range(4):
            if self.value(0x1400 + number, 1) & (OFF | 0x7FF) == can_id:
                for index, subindex in self._mapped(0x1600 + number):
                    size = len(self._node.get_data(index, subindex))
                    self._node.set_data(index, subindex, bytes(data[:size]))
                    data = data[size:]

    def _mapped(self, record: int) -> list[tuple[int, int]]:
        entries = (self.value(record, n) for n in range(1, self.value(record) + 1))
        return [(entry >> 16, entry >> 8 & 0xFF) for entry in entries]

    def _beat(self, period: float) -> None:
        self._since_beat += period
        interval = self.value(0x1017) / 1000
        if interval and self._since_beat >= interval:
            self._since_beat = 0.0
            self._network.send_message(HEARTBEAT + self._node.id, b"\x05")

    # The drive

    def _show(self, index: int, subindex: int, od: Any) -> int | None:
        del od, subindex
        if index == 0x6041:
            rests = self.velocity == 0 and abs(self.target - self.position) < 1
            flags = (0x400 if rests else 0) | (0x1000 if self.acknowledged else 0)
            return STATES[self.state] | 0x210 | flags
        if index == 0x6061:
            return self.value(0x6060)
        if index == 0x6064:
            return round(self.position)
        if index == 0x6078:
            return round(math.copysign(FRICTION, self.velocity)) if self.velocity else 0
        return None

    def _take(self, index: int, subindex: int, od: Any, data: bytes) -> None:
        del od, subindex
        if index == 0x6040:
            self._control(*struct.unpack("<H", data))

    def _control(self, word: int) -> None:
        risen, self._word = word & ~self._word, word
        if not word & 0x02 or (not word & 0x04 and self.state != "enabled"):
            self._enter("off")
        elif not word & 0x04:
            self._enter("stopping")
        elif following := WAYS.get(word & 0x0F, {}).get(self.state):
            self._enter(following)
        elif self.state == "enabled" and risen & 0x10:
            self.target, self.acknowledged = float(self.value(0x607A)), True
        elif not word & 0x10:
            self.acknowledged = False

    def _enter(self, state: str) -> None:
        self.state = state
        self.history.append(state)
        self.target, self.velocity, self.acknowledged = self.position, 0.0, False

    def _move(self, period: float) -> None:
        if self.state == "stopping":
            self._enter("off")
        if self.state != "enabled" or self._word & 0x100:
            self.velocity = 0.0
            return
        rest, step = self.target - self.position, self.value(0x6083) * period
        wanted = min(self.value(0x6081), math.sqrt(2 * self.value(0x6084) * abs(rest)))
        wanted = math.copysign(wanted, rest)
        self.velocity += min(max(wanted - self.velocity, -step), step)
        if abs(rest) <= abs(self.velocity) * period:
            self.position, self.velocity = self.target, 0.0
        self.position += self.velocity * period
