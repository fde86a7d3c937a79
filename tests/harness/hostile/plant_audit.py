"""Audit of a plant under hostile frames: no motion without a legal command.

An axis is *moved by a frame* when, while that frame is handled, its drive asks the servo to
`enable` or to `move`; nothing else in the plant turns a motor. That is legal only where

- the drive received a controlword (6040h) by this frame or by a PDO applied at this SYNC, or starts
  a set-point from its buffer;
- the frame may carry a controlword: a plain 11-bit data frame, either a download to 6040h confirmed
  by the drive, or an enabled and sufficiently long RPDO with 6040h mapped;
- controlword and previous state permit the call: to enable, bits 0 to 3 (bit 7 counts in FAULT
  only) in READY or SWITCHED ON; to move, OPERATION ENABLED and a new set-point or the release of
  halt;
- target, velocity, acceleration and deceleration are within the drive's limits.

So only a random RPDO that is a legal set-point of an enabled drive may move the axis. An axis not
enabled by its drive must not move at all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from drivers.cia402.states import State, decode_state
from hostile.frames import plain
from hostile.harm import Harm

if TYPE_CHECKING:
    from collections.abc import Sequence

    import can

    from sim_plant.machine_protocol import Axis, Machine
    from sim_plant.slave_network import SlaveNetwork

CONTROLWORD, STATUSWORD = 0x6040, 0x6041
OFF, IDENTIFIER, NEW_SET_POINT, HALT = 1 << 31, 0x7FF, 0x10, 0x100
SLACK = 1e-3
"""Permitted displacement of a braked axis [rad]."""


class Call(NamedTuple):
    """Call of a servo by its drive."""

    axis: int
    what: str
    arguments: tuple[float, ...]


class WatchedAxis:
    """Servo that records the frame causing each call."""

    def __init__(self, number: int, axis: Axis, calls: list[Call]) -> None:
        self._number, self._axis, self._calls = number, axis, calls

    def enable(self) -> None:
        """Record the call and forward it."""
        self._calls.append(Call(self._number, "enable", ()))
        self._axis.enable()

    def move(self, *arguments: float) -> None:
        """Record the call and forward it."""
        self._calls.append(Call(self._number, "move", arguments))
        self._axis.move(*arguments)

    def __getattr__(self, name: str) -> object:
        return getattr(self._axis, name)


def watched(machine: Machine) -> list[Call]:
    """Record the calls of the machine's servos in the returned list."""
    calls: list[Call] = []
    machine.axes = [WatchedAxis(n, axis, calls) for n, axis in enumerate(machine.axes)]  # type: ignore[misc]
    return calls


class PlantAudit:
    """Judge of every frame by the plant's reaction."""

    def __init__(self, network: SlaveNetwork, calls: list[Call]) -> None:
        self.controlwords = self.enabled = self.moved = 0
        self._network = network
        self._calls = calls
        self._taken: list[tuple[int, int]] = []
        self._words = dict.fromkeys(range(len(network.nodes)), 0)
        self._accepted = dict.fromkeys(range(len(network.nodes)), 0)
        # Last frame of each identifier and length: nodes may follow different SYNCs, and a frame
        # that is too short does not replace a queued one.
        self._waiting: dict[tuple[int, int], can.Message] = {}
        self._downloads: dict[int, bool] = {}
        self._before: list[State | None] = []
        for axis, node in enumerate(network.nodes):
            node.dictionary.react(CONTROLWORD, lambda _sub, word, a=axis: self._take(a, word))

    def _take(self, axis: int, word: int) -> None:
        self._taken.append((axis, word))

    def expect(self, frame: can.Message) -> None:
        """Record the state before `frame` is handled."""
        words = (node.dictionary.get(STATUSWORD) for node in self._network.nodes)
        self._before = [decode_state(word) for word in words]
        if plain(frame):
            self._waiting[frame.arbitration_id, len(frame.data)] = frame

    def judge(self, frame: can.Message, answers: Sequence[can.Message]) -> None:
        """Compare the reaction with the permission of `frame`.

        Raises
        ------
        Harm
        """
        self._follow_downloads(frame, answers)
        released = set()
        for axis, word in self._taken:
            self.controlwords += 1
            if not self._carries(frame, answers, axis):
                raise Harm(f"{frame}: no command for axis {axis + 1}, yet it took {word:04X}h")
            risen, fallen = word & ~self._words[axis], self._words[axis] & ~word
            self._accepted[axis] += bool(risen & NEW_SET_POINT)
            if fallen & HALT:
                released.add(axis)
            self._words[axis] = word
        for call in self._calls:
            self._justify(call, frame, released)
        self._taken.clear()
        self._calls.clear()

    def _justify(self, call: Call, frame: can.Message, released: set[int]) -> None:
        axis, before = call.axis, self._before[call.axis]
        words = [word for taker, word in self._taken if taker == axis]
        twice = len(words) > 1  # an RPDO with 6040h mapped twice causes two transitions
        if call.what == "enable":
            self.enabled += 1
            ready = before in (State.READY_TO_SWITCH_ON, State.SWITCHED_ON)
            if not ((ready or twice) and any(word & 0x0F == 0x0F for word in words)):
                raise Harm(f"{frame}: axis {axis + 1} was enabled in {before} by {words}")
            return
        self.moved += 1
        self._accepted[axis] -= axis not in released
        enabled = before is State.OPERATION_ENABLED or twice
        if not enabled or self._accepted[axis] < 0:
            raise Harm(f"{frame}: axis {axis + 1} moved in {before} by {words} without set-point")
        # a buffered set-point was checked on arrival
        if any(word & NEW_SET_POINT for word in words):
            self._check_limits(call)

    def _check_limits(self, call: Call) -> None:
        dictionary = self._network.nodes[call.axis].dictionary
        target, velocity, acceleration, deceleration = call.arguments
        low, high = dictionary.get(0x607D, 1), dictionary.get(0x607D, 2)
        within = (
            not low < high or low <= target <= high,
            0 < velocity <= max(1, dictionary.get(0x607F)),
            0 < acceleration <= dictionary.get(0x60C5),
            0 < deceleration <= dictionary.get(0x60C6),
        )
        if not all(within):
            raise Harm(f"axis {call.axis + 1}: {call.arguments} is beyond the drive's limits")

    def _follow_downloads(self, frame: can.Message, answers: Sequence[can.Message]) -> None:
        """Track whether each node's present transfer is a download to 6040h, from the wire."""
        node = frame.arbitration_id - 0x600
        if not (plain(frame) and 1 <= node <= 127 and len(frame.data) == 8):
            return
        for answer in answers:
            if answer.arbitration_id == 0x580 + node and answer.data[0] in (0x60, 0xA4):
                self._downloads[node] = answer.data[1:4] == b"\x40\x60\x00"

    def _carries(self, frame: can.Message, answers: Sequence[can.Message], axis: int) -> bool:
        node = self._network.nodes[axis].node_id
        if not plain(frame):
            return False
        if frame.arbitration_id == 0x600 + node:
            return self._is_confirmed(frame, answers, node)
        sync = self._network.nodes[axis].sync_identifier
        carriers = self._waiting.values() if frame.arbitration_id == sync else (frame,)
        return any(self._is_pdo(carrier, axis) for carrier in carriers)

    def _is_confirmed(self, frame: can.Message, answers: Sequence[can.Message], node: int) -> bool:
        answer = next((a.data for a in answers if a.arbitration_id == 0x580 + node), bytes(8))
        if frame.data[0] & 0xE2 == 0x22 and len(frame.data) == 8:
            return frame.data[1:4] == b"\x40\x60\x00" and answer[:4] == b"\x60\x40\x60\x00"
        return self._downloads.get(node, False) and answer[0] in (0x20, 0x30, 0xA1)

    def _is_pdo(self, frame: can.Message, axis: int) -> bool:
        dictionary = self._network.nodes[axis].dictionary
        for number in range(4):
            cob_id = dictionary.get(0x1400 + number, 1)
            count = dictionary.get(0x1600 + number)
            mapped = [dictionary.get(0x1600 + number, n) for n in range(1, count + 1)]
            size = sum(entry & 0xFF for entry in mapped) // 8
            on = not cob_id & OFF and cob_id & IDENTIFIER == frame.arbitration_id
            if on and len(frame.data) >= size and CONTROLWORD << 16 | 16 in mapped:
                return True
        return False
