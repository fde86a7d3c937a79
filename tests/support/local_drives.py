"""Independent drives: canopen's LocalNode with the minimum of CiA 402.

They share one bus object in lock-step, move at constant velocity, and can have the defects required
by tests. Nothing here is taken from the plant.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import can
import canopen
from canopen.objectdictionary import ODRecord, ODVariable, datatypes
from canopen.sdo.exceptions import SdoAbortedError

if TYPE_CHECKING:
    from collections.abc import Callable

TYPES = {
    "u8": datatypes.UNSIGNED8,
    "u16": datatypes.UNSIGNED16,
    "u32": datatypes.UNSIGNED32,
    "i8": datatypes.INTEGER8,
    "i16": datatypes.INTEGER16,
    "i32": datatypes.INTEGER32,
}
PERIOD = 0.004

OBJECTS: dict[tuple[int, int], tuple[str, int]] = {
    (0x1000, 0): ("u32", 0x00020192),
    (0x1001, 0): ("u8", 0),
    (0x1005, 0): ("u32", 0x80),
    (0x1006, 0): ("u32", 0),
    (0x1016, 1): ("u32", 0),
    (0x1017, 0): ("u16", 0),
    (0x1018, 1): ("u32", 0x4D2),
    (0x1018, 2): ("u32", 0x402),
    (0x1018, 3): ("u32", 0x10000),
    (0x1400, 1): ("u32", 0x80000200),
    (0x1400, 2): ("u8", 255),
    (0x1600, 0): ("u8", 0),
    **{(0x1600, sub): ("u32", 0) for sub in (1, 2, 3)},
    **{
        (0x1800 + pdo, sub): (kind, value)
        for pdo in (0, 1)
        for sub, kind, value in ((1, "u32", 0x80000180), (2, "u8", 255))
    },
    **{(0x1A00 + pdo, 0): ("u8", 0) for pdo in (0, 1)},
    **{(0x1A00 + pdo, sub): ("u32", 0) for pdo in (0, 1) for sub in (1, 2, 3)},
    (0x6007, 0): ("i16", 0),
    (0x603F, 0): ("u16", 0),
    (0x6040, 0): ("u16", 0),
    (0x6041, 0): ("u16", 0),
    (0x605A, 0): ("i16", 2),
    (0x6060, 0): ("i8", 0),
    (0x6061, 0): ("i8", 0),
    (0x6064, 0): ("i32", 0),
    (0x6065, 0): ("u32", 0),
    (0x6066, 0): ("u16", 0),
    (0x6072, 0): ("u16", 0),
    (0x6075, 0): ("u32", 2000),
    (0x6076, 0): ("u32", 1000),
    (0x6078, 0): ("i16", 0),
    (0x607A, 0): ("i32", 0),
    (0x607D, 1): ("i32", 0),
    (0x607D, 2): ("i32", 0),
    (0x607F, 0): ("u32", 0),
    (0x6081, 0): ("u32", 0),
    (0x6083, 0): ("u32", 0),
    (0x6084, 0): ("u32", 0),
    (0x6502, 0): ("u32", 1),
}

STATES = {
    "off": 0x40,
    "ready": 0x21,
    "on": 0x23,
    "enabled": 0x27,
    "stopping": 0x07,
    "fault": 0x08,
}


def dictionary(objects: dict[tuple[int, int], tuple[str, int]]) -> canopen.ObjectDictionary:
    od = canopen.ObjectDictionary()
    for (index, sub), (kind, value) in objects.items():
        variable = ODVariable(f"{index:04X}:{sub}", index, sub)
        variable.data_type, variable.default, variable.access_type = TYPES[kind], value, "rw"
        if any(i == index and s for i, s in objects):
            if index not in od:
                od.add_object(ODRecord(f"{index:04X}", index))
            od[index].add_member(variable)
        else:
            od.add_object(variable)
    return od


class LocalNetwork(canopen.Network):
    """Network that puts frames of LocalNodes on the bus, without threads."""

    def __init__(self, emit: Callable[[int, bytes], None]) -> None:
        super().__init__()
        self.emit = emit

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        self.emit(can_id, bytes(data))

    def send_periodic(self, *args: Any, **kwargs: Any) -> Any:
        return _NoTask()


class _NoTask:
    def stop(self) -> None:
        pass

    def update(self, data: bytes) -> None:
        pass


class LocalDrive:
    """Drive with settable defects.

    `state` is a key of STATES; `history` holds all previous states. `stuck` states are not left by
    command; objects in `insists` keep their values after a write. A drive that `stays_stopped` does
    not switch off by itself after a stop; a drive that `sags` moves by this number of increments
    after power-off. `forbids(index, sub-index, value)` returns the code with which a write is
    aborted, `hides(index, sub-index)` that of a read.
    """

    def __init__(
        self, node: int, objects: dict[tuple[int, int], tuple[str, int]], network: LocalNetwork
    ) -> None:
        self.node = canopen.LocalNode(node, dictionary(objects))
        self.node.associate_network(network)
        self.node.add_read_callback(self._read)
        self.node.add_write_callback(self._write)
        self.network = network
        self.state = "off"
        self.history: list[str] = ["off"]
        self.words: list[int] = []
        self.position = self.target = 0.0
        self.halted = self.acknowledge = False
        self.deaf_to_set_points = self.immobile = self.ignores_mode = False
        self.stuck: set[str] = set()
        self.insists: dict[tuple[int, int], int] = {}
        self.forbids: Callable[[int, int, int], int | None] = lambda *_: None
        self.hides: Callable[[int, int], int | None] = lambda *_: None
        self.heart_beats = self.powered = True
        self.stays_stopped = False
        self.sags = 0.0
        self.extra_status = 0
        self._since_beat = 0.0

    @property
    def statusword(self) -> int:
        reached = abs(self.target - self.position) < 0.5 or self.halted
        word = STATES[self.state] | 0x0200 | self.extra_status
        return word | (0x0400 if reached else 0) | (0x1000 if self.acknowledge else 0)

    def value(self, index: int, sub: int = 0) -> int:
        return int.from_bytes(self.node.get_data(index, sub), "little", signed=False)

    def go(self, state: str) -> None:
        if self.state not in self.stuck:
            self.state = state
            self.history.append(state)

    def fail(self, code: int) -> None:
        self.go("fault")
        self.node.set_data(0x603F, 0, code.to_bytes(2, "little"))
        self.network.emit(0x80 + self.node.id, code.to_bytes(2, "little") + bytes(6))

    def control(self, word: int) -> None:
        last = self.words[-1] if self.words else 0
        self.words.append(word)
        if self.state == "fault":
            if word & ~last & 0x80:
                self.go("off")
        elif not word & 0x02:
            self.go("off")
        elif not word & 0x04:
            self.go("stopping" if self.state == "enabled" else "off")
            self.target = self.position
        else:
            self._command(word & 0x0F)
            if self.state == "enabled":
                self._set_point(word, last)

    def step(self) -> None:
        if self.state == "stopping" and not self.stays_stopped:
            self.go("off")
        elif self.state == "off" and self.sags:
            way = min(self.sags, 50.0)
            self.position, self.sags = self.position + way, self.sags - way
            self.target = self.position
        velocity = self.value(0x6081) * PERIOD
        if self.state == "enabled" and not (self.halted or self.immobile):
            self.position += min(max(self.target - self.position, -velocity), velocity)

    def answer_sync(self) -> None:
        self.step()
        if self.node.nmt.state != "OPERATIONAL":
            return
        for pdo in (0x1800, 0x1801):
            cob_id = self.value(pdo, 1)
            if not cob_id & 1 << 31:
                self.network.emit(cob_id & 0x7FF, self._mapped(pdo + 0x200))
        self._beat()

    def receive(self, data: bytes) -> None:
        offset = 0
        for sub in range(1, self.value(0x1600, 0) + 1):
            entry = self.value(0x1600, sub)
            size = (entry & 0xFF) // 8
            self.node.set_data(entry >> 16, entry >> 8 & 0xFF, data[offset : offset + size])
            offset += size

    def _command(self, bits: int) -> None:
        ways = {
            6: {"off": "ready", "on": "ready", "enabled": "ready"},
            7: {"ready": "on", "enabled": "on"},
            15: {"on": "enabled"},
        }
        following = ways.get(bits, {}).get(self.state)
        if following == "enabled":
            self.target = self.position
        if following:
            self.go(following)

    def _set_point(self, word: int, last: int) -> None:
        self.halted = bool(word & 0x100)
        if word & ~last & 0x10 and not self.deaf_to_set_points:
            self.acknowledge = True
            raw = self.node.get_data(0x607A, 0)
            self.target = float(int.from_bytes(raw, "little", signed=True))
        elif not word & 0x10:
            self.acknowledge = False

    def _mapped(self, index: int) -> bytes:
        entries = (self.value(index, sub) for sub in range(1, self.value(index, 0) + 1))
        return b"".join(self.node.get_data(entry >> 16, entry >> 8 & 0xFF) for entry in entries)

    def _beat(self) -> None:
        self._since_beat += PERIOD
        interval = self.value(0x1017) / 1000
        if self.heart_beats and interval and self._since_beat >= interval:
            self._since_beat = 0.0
            self.network.emit(0x700 + self.node.id, b"\x05")

    def _read(self, index: int, subindex: int, od: Any) -> int | None:
        code = self.hides(index, subindex)
        if code is not None:
            raise SdoAbortedError(code)
        if (index, subindex) in self.insists:
            return self.insists[index, subindex]
        match index:
            case 0x6041:
                return self.statusword
            case 0x6064:
                return round(self.position)
            case 0x6061:
                return 0 if self.ignores_mode else self.value(0x6060)
        return None

    def _write(self, index: int, subindex: int, od: Any, data: bytes) -> None:
        code = self.forbids(index, subindex, int.from_bytes(data, "little"))
        if code is not None:
            raise SdoAbortedError(code)
        if index == 0x6040:
            self.control(int.from_bytes(data, "little"))


class LocalBus(can.BusABC):
    """All drives on one python-can bus in lock-step.

    `outgoing` may drop, double or delay the drives' frames; `on_send` gets frames of the master,
    and may raise an exception.
    """

    lock_step = True

    def __init__(self, nodes: int, changes: dict[int, dict[tuple[int, int], Any]]) -> None:
        super().__init__("local")
        self.channel_info = "local drives"
        self.inbox: deque[can.Message] = deque()
        self.sent: list[can.Message] = []
        self.syncs = 0
        self.outgoing: Callable[[can.Message], list[can.Message]] = lambda frame: [frame]
        self.on_send: Callable[[can.Message], None] = lambda _: None
        self.network = LocalNetwork(self._emit)
        self.drives = {
            node: LocalDrive(node, _changed(changes.get(node, {})), self.network)
            for node in range(1, nodes + 1)
        }

    def _emit(self, can_id: int, data: bytes) -> None:
        node = can_id & 0x7F
        if node in self.drives and not self.drives[node].powered:
            return
        frame = can.Message(arbitration_id=can_id, data=data, is_extended_id=False)
        self.inbox.extend(self.outgoing(frame))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append(msg)
        self.on_send(msg)
        can_id, data = msg.arbitration_id, bytes(msg.data)
        if can_id == 0x80:
            self.syncs += 1
            for drive in self.drives.values():
                drive.answer_sync()
        elif can_id >> 7 == 4 and can_id & 0x7F in self.drives:
            self.drives[can_id & 0x7F].receive(data)
        self.network.notify(can_id, bytearray(data), 0.0)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self.inbox.popleft() if self.inbox else None), False


class TimedBus(LocalBus):
    """Local drives with their own time, which passes with frames and during waits."""

    FRAME = 1e-4
    """Duration of a frame [s]."""

    def __init__(self, nodes: int, changes: dict[int, dict[tuple[int, int], Any]]) -> None:
        self.time = 0.0
        super().__init__(nodes, changes)

    def clock(self) -> float:
        return self.time

    def recv(self, timeout: float | None = None) -> can.Message | None:
        if not self.inbox:
            self.time += timeout or 0.0
            return None
        self.time += self.FRAME
        return self.inbox.popleft()


def _changed(changes: dict[tuple[int, int], Any]) -> dict[tuple[int, int], tuple[str, int]]:
    objects = {**OBJECTS, **{key: value for key, value in changes.items() if value is not None}}
    return {key: value for key, value in objects.items() if changes.get(key, value) is not None}
