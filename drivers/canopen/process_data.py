"""Exchange of process data: SYNC out, the TPDOs of all drives in.

Every frame that answers a SYNC has a slot; the slots of one axis are adjacent, so that one
precompiled struct unpacks the joined frames of all axes at once. If a fixed TPDO has another order
or further objects, an `itemgetter` selects the values. Irregularities leave this fast path: a
missing, doubled or late TPDO is flagged and never replaced by an estimate. After a missing TPDO the
axis owes one: if two come for the next SYNC, the first is the late one and is dropped. If only one
comes, either the owed TPDO was lost or all TPDOs lag by a SYNC: the TPDO is flagged, for some
SYNCs, unless all answers are known to be in.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import can

from drivers.can_bus.capabilities import FrameBlock, find_capabilities
from drivers.canopen.network import SEND_ATTEMPTS
from drivers.cia402.objects import POSITION, STATUSWORD
from drivers.cia402.set_point import ENABLED
from drivers.cycle_data import CODES, Cycles, ProcessData, make_unpacker
from drivers.drive_bus import DriveError, SampleFlag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.canopen.communication import CanopenCommunication
    from drivers.canopen.network import PumpedNetwork
    from drivers.drives_file import AxisDrive
    from drivers.sync_clock import SyncClock

SYNC = can.Message(arbitration_id=0x80, is_extended_id=False)
BABBLE = 1000
"""Largest number of frames read after the time of an answer: a node may send without end."""

DOUBT = 5
"""Number of SYNCs with a single answer each, after which an owed TPDO counts as lost."""

_COMMAND, _TARGET = struct.Struct("<iH"), struct.Struct("<i")
_OFFSETS = struct.Struct("<ih")
Data = bytes | bytearray


class SyncProcessData(ProcessData):
    """Process data of CANopen axes (`drivers.cycle_data.ProcessData`).

    Parameters
    ----------
    network : PumpedNetwork
        Network of the drives.
    axes : sequence of AxisDrive
        Axes in joint order.
    clock : SyncClock
        Source of SYNC's time.
    communications : sequence of CanopenCommunication
        See `wire`.
    """

    def __init__(
        self,
        network: PumpedNetwork,
        axes: Sequence[AxisDrive],
        clock: SyncClock,
        communications: Sequence[CanopenCommunication],
    ) -> None:
        super().__init__(len(axes), clock)
        self._network = network
        self._in_lock_step = clock.synchronous
        self._receive = network.channel.recv
        self._blocks = find_capabilities(network.channel).blocks if clock.synchronous else None
        self.looks_ahead = self._blocks is not None
        self._wanted = [(STATUSWORD, POSITION, drive.current.entry) for drive in axes]
        self._slots: dict[int, int] = {}
        self.wire(communications)

    def wire(self, communications: Sequence[CanopenCommunication]) -> None:
        """Use the PDOs of the drives as set up, from the next SYNC on."""
        inputs = [drive.inputs for drive in communications]
        self._commands = [each.command.cob_id for each in inputs]
        self._offsets = [each.offsets.cob_id for each in inputs if each.offsets]
        self.on_arrival = tuple(k for k, each in enumerate(inputs) if not each.synchronous)
        self._targets = [
            None if self.on_arrival or each.target in {each.command, None} else each.target.cob_id
            for each in inputs
        ]
        for cob_id in self._slots:
            self._network.unsubscribe(cob_id, self._take_late)
        pdos = [(axis, pdo) for axis, each in enumerate(communications) for pdo in each.transmitted]
        layouts = ["".join(CODES.get(e.type, "x" * e.size) for e in pdo.entries) for _, pdo in pdos]
        self._slots = {pdo.cob_id: slot for slot, (_, pdo) in enumerate(pdos)}
        self._sizes = [pdo.size for _, pdo in pdos]
        self._axis_of = [axis for axis, _ in pdos]
        # indices of statusword, position and current of each axis among all values
        values = [
            (axis, entry) for axis, pdo in pdos for entry in pdo.entries if entry.type in CODES
        ]
        wanted = [(axis, entry) for axis, entries in enumerate(self._wanted) for entry in entries]
        order = [values.index(each) for each in wanted]
        self._unpack = make_unpacker("<" + "".join(layouts), order)
        self._block = FrameBlock([pdo.cob_id for _, pdo in pdos], layouts, order)
        self._last_block, self._complete = b"", False
        self._last: list[Data] = [bytes(size) for size in self._sizes]
        self._owed: dict[int, int] = {}
        self._doubt: dict[int, int] = {}
        self._found: dict[int, int] = {}
        for cob_id in self._slots:
            self._network.subscribe(cob_id, self._take_late)

    def command(self, axis: int, target: int, controlword: int) -> None:
        """Send target position [increments] and controlword to an axis."""
        self._network.send_message(self._commands[axis], _COMMAND.pack(target, controlword))

    def lead(self, axis: int, target: int) -> None:
        """Send a streamed set-point to an axis [increments]."""
        cob_id = self._targets[axis]
        if cob_id is None:
            self.command(axis, target, ENABLED)
        else:
            self._network.send_message(cob_id, _TARGET.pack(target))

    def feed_forward(self, axis: int, velocity: int, torque: int) -> None:
        """Send offsets of velocity [drive's unit] and torque [per mille of rated] to an axis."""
        self._network.send_message(self._offsets[axis], _OFFSETS.pack(velocity, torque))

    def withdraw(self, axis: int) -> None:
        """Cancel the feed-forward of an axis; no effect where drives take no offsets."""
        if self._offsets:
            self.feed_forward(axis, 0, 0)

    def sync(self) -> float:
        """Send the next SYNC when due, collect answers; return its instant (see `ProcessData`)."""
        clock = self._clock
        if not self._in_lock_step:
            self._network.pump(clock.due())
        clock.note_sending()
        try:
            self._network.channel.send(SYNC)
        except Exception as error:
            self._send_again(error)
        instant = clock.note_sent()
        self._receive_answers(instant)
        return instant

    def sync_ahead(self, times: int) -> Cycles | None:
        """Send several SYNCs if the last one was answered completely (see `ProcessData`)."""
        if times == 1 or self._blocks is None or not self._complete or self.irregular:
            return super().sync_ahead(times)
        try:
            blocks = self._blocks.send_repeatedly(SYNC, times)
        except Exception as error:
            self._send_again(error)
            blocks = []
        cycles = Cycles([], [], [])
        for frames in blocks:
            instant = self._clock.note_sent()
            self._pass_to(instant)
            heartbeats, block = self._block.split(frames)
            for identifier, size, data in heartbeats:
                self._network.notify(identifier, bytearray(data[:size]), instant)
            values = self._block.unpack(block)
            if values is None or values[0::3] != self.words:
                reason = ValueError(f"unexpected frames answered {len(blocks)} SYNCs")
                raise self._network.unavailable("cannot receive", reason)
            self.positions = values[1::3]
            cycles.times.append(instant)
            cycles.positions.append(values[1::3])
            cycles.currents.append(values[2::3])
            self._last_block = block
        self._receive_answers(self._clock.note_sent())
        return cycles if blocks else None

    def _receive_answers(self, instant: float) -> None:
        clock = self._clock
        self.untimed = clock.uncertain
        try:
            values = self._take_block() or self._unpack(b"".join(self._collect(clock)))
        except Exception as error:
            raise self._network.unavailable("cannot receive", error) from error
        self._pass_to(instant)
        self.words, self.positions, self.currents = values[0::3], values[1::3], values[2::3]
        if self._found or self.irregular or clock.passed_over:
            found, self._found = self._found, {}
            self._publish(found)

    def _send_again(self, error: Exception) -> None:
        """Repeat a SYNC refused by the bus; in lock-step a period passes with each attempt."""
        if not self._in_lock_step:
            return self._network.send_again(SYNC, error)
        for _ in range(1, self._network.attempts):
            if isinstance(error, DriveError):
                raise error
            self._clock.miss()
            try:
                return self._network.channel.send(SYNC)
            except Exception as again:
                error = again
        raise self._network.unavailable("SYNC cannot be sent", error)

    def hurry(self, hurried: bool) -> None:
        """Shorten waits to the time available during a stop of the axes, or restore them."""
        self._network.attempts = 1 if hurried else SEND_ATTEMPTS
        super().hurry(hurried)

    def tick(self) -> None:
        """Let a period pass while the drives send no TPDOs yet."""
        self._network.pump(self._clock.due())
        self._clock.note_sending()
        self._network.send_frame(SYNC)
        self._clock.note_sent()
        self._network.pump(0.0)

    def _take_block(self) -> tuple[int, ...] | None:
        """Return the values of answers in one block; None if frames must be read one by one."""
        if self._blocks is None or self._owed or (block := self._blocks.recv_block()) is None:
            return None
        values = self._block.unpack(block)
        if values is None:
            self._blocks.put_back(block)
        else:
            self._last_block, self._complete = block, True
        return values

    def _collect(self, clock: SyncClock) -> list[Data]:
        """Return the content of each frame, or the previous content of a missing frame."""
        receive, slots, sizes = self._receive, self._slots, self._sizes
        in_lock_step = self._in_lock_step
        timeout = 0.0 if in_lock_step else clock.window()
        frames: list[Data] = [b""] * len(sizes)
        missing, spare = len(sizes), BABBLE
        while (frame := receive(timeout)) is not None:
            slot = slots.get(frame.arbitration_id)
            data = frame.data
            if (
                slot is None
                or len(data) != sizes[slot]
                or frame.is_error_frame
                or frame.is_extended_id
            ):
                self._network.dispatch(frame)
            elif frames[slot]:  # of two TPDOs, the first is the owed one
                if slot in self._owed:
                    self._settle(slot)
                    frames[slot] = data
                    self._mark(slot, SampleFlag.LATE)
                else:
                    self._mark(slot, SampleFlag.DOUBLED)
            else:
                frames[slot] = data
                missing -= 1
            if not in_lock_step:
                spare -= timeout == 0.0
                if not ((missing or self._owed) and spare):
                    break
                timeout = clock.window()
        if missing or self._owed:
            self._fill(frames)
        self._last, self._last_block = frames, b""
        self._complete = not (missing or self._owed)
        return frames

    def _fill(self, frames: list[Data]) -> None:
        if self._last_block:
            self._last = [*self._block.data(self._last_block)]
            self._last_block = b""
        for slot, data in enumerate(frames):
            if not data:
                frames[slot] = self._last[slot]
                self._owed[slot] = self._owed.get(slot, 0) + 1
                self._doubt[slot] = 0 if self._in_lock_step else DOUBT
                self._mark(slot, SampleFlag.MISSING)
            elif slot in self._owed:  # an answer came alone although another is owed
                if self._doubt[slot]:
                    self._doubt[slot] -= 1
                    self._mark(slot, SampleFlag.LATE)
                else:
                    del self._owed[slot]

    def _settle(self, slot: int) -> None:
        """Count an owed TPDO as arrived."""
        if self._owed.get(slot, 0) > 1:
            self._owed[slot] -= 1
        else:
            self._owed.pop(slot, None)

    def _take_late(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del timestamp
        slot = self._slots[can_id]
        if len(data) == self._sizes[slot]:
            self._settle(slot)
            self._mark(slot, SampleFlag.LATE)
        else:
            self.misfits[self._axis_of[slot]] = (
                f"TPDO {can_id:03X}h has {len(data)} bytes, {self._sizes[slot]} were mapped: the "
                "drive restarted, or another master changed the mapping"
            )

    def _mark(self, slot: int, flag: SampleFlag) -> None:
        axis = self._axis_of[slot]
        self._found[axis] = self._found.get(axis, 0) | flag.value
