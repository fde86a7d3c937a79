"""Cyclic frames with process data: a layout computed once and reused.

Masters send the same datagrams in every cycle, with other data. As long as sync managers, FMMUs and
cables do not change, each byte of such a frame has a fixed address in the memory of a slave. So the
first frame is processed datagram by datagram, and frames of equal layout are copied.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from sim_plant.ethercat import registers as reg
from sim_plant.ethercat.clock import HOP
from sim_plant.ethercat.frame import (
    DATAGRAMS,
    HEADER_SIZE,
    LOGICAL,
    Command,
    datagrams,
    mark_passed,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_plant.ethercat.controller import Controller, LogicalPart, SyncManager
    from sim_plant.ethercat.frame import Datagram
    from sim_plant.ethercat.slave import EthercatSlave

_COUNTER = struct.Struct("<H")
_INDEX = 17
"""Place of the first datagram's number, different in every frame."""
_TIME = 8
"""Size of a system time [bytes]."""


class _Copy(NamedTuple):
    """Bytes of a slave's memory, with the corresponding bytes of a frame."""

    memory: bytearray
    there: slice
    here: slice


class _Shown(NamedTuple):
    """Registers of all slaves in a datagram, combined by bitwise or."""

    controllers: Sequence[Controller]
    place: int
    start: int
    end: int

    def show(self, frame: bytes, passing: bytearray) -> None:
        """Write the registers to the answer of a frame."""
        for there, here in enumerate(range(self.start, self.end), self.place):
            bits = frame[here]
            for controller in self.controllers:
                bits |= controller.memory[there]
            passing[here] = bits


class _Reference(NamedTuple):
    """System time of the reference slave in a datagram for all slaves.

    Attributes
    ----------
    slave, delay
        Reference slave, and delay of the frame on its way there [ns].
    others : sequence of (EthercatSlave, int)
        Other slaves that receive this time, with the delays of the frame to them [ns].
    """

    slave: EthercatSlave
    delay: int
    others: Sequence[tuple[EthercatSlave, int]]
    start: int


class CyclicFrame:
    """Layout of frames, with the bytes to copy.

    Parameters
    ----------
    slaves : sequence of EthercatSlave
        Slaves that a frame reaches.
    frame : bytes
        Frame as received.

    Attributes
    ----------
    by_frames : list of EthercatSlave
        Slaves with outputs acting on frames, not at SYNC0.
    is_plain : bool
        True if the frame has only process data of all slaves, registers to read, and the first
        slave's time. Other frames are processed datagram by datagram.
    is_repeated : bool
        True if the last frame equals the frame before it, except for the number.
    """

    def __init__(self, slaves: Sequence[EthercatSlave], frame: bytes) -> None:
        self._slaves = slaves
        self._controllers = [slave.controller for slave in slaves]
        self._set_up = [(controller, controller.managers) for controller in self._controllers]
        self._size = len(frame)
        self._written: list[_Copy] = []
        self._read: list[_Copy] = []
        self._shown: list[_Shown] = []
        self._references: list[_Reference] = []
        self._counted: list[tuple[slice, bytes]] = []
        self.is_plain, self.is_repeated = True, False
        self._before: bytes | None = None
        self._answer = bytearray()
        layout, end = "<12x4s", DATAGRAMS  # header of an EtherCAT frame: type, length, kind
        for datagram in datagrams(bytearray(frame)):
            layout += f"{datagram.place - end}xBx6s2x{datagram.size}xH"
            end = datagram.place + HEADER_SIZE + datagram.size + _COUNTER.size
            if datagram.command in LOGICAL:
                self._lay(datagram)
            elif datagram.command is Command.BRD and datagram.offset < reg.PROCESS_MEMORY:
                self._show(datagram)
            elif datagram.command is Command.FRMW and datagram.offset == reg.SYSTEM_TIME:
                self._refer(datagram)
            else:
                self.is_plain = False
        self._layout = struct.Struct(layout)
        self._head = self._layout.unpack_from(frame)
        self.is_plain &= not any(self._head[3::3])  # counters, which begin at zero
        self.is_plain &= {id(each.memory) for each in self._written} == {
            id(controller.memory) for controller in self._controllers
        } and len(self._written) == len(self._controllers)
        self.by_frames = [slave for slave in slaves if not slave.clock.cycle]

    def fits(self, frame: bytes) -> bool:
        """Return True if a frame has this layout and the slaves' configuration is unchanged."""
        if _content(frame) != self._before and (
            len(frame) != self._size or self._layout.unpack_from(frame) != self._head
        ):
            return False
        return all(controller.set_up is managers for controller, managers in self._set_up)

    def passed(self, frame: bytes) -> bytes:
        """Return the answer to a frame of this layout."""
        content = _content(frame)
        self.is_repeated = content == self._before
        if self.is_repeated:  # corresponding bytes of the previous answer
            passing = bytearray(self._answer)
            passing[_INDEX] = frame[_INDEX]
        else:
            passing = bytearray(frame)
            for here, count in self._counted:  # working counters, and slaves passed by
                passing[here] = count
            mark_passed(passing)
        for memory, there, here in self._read:
            passing[here] = memory[there]
        if not self.is_repeated:
            for memory, there, here in self._written:
                memory[there] = frame[here]
        for slave, delay, others, start in self._references:
            time = passing[start : start + _TIME] = slave.time(delay)
            for other, behind in others:
                other.take_time(time, behind)
        for registers in self._shown:
            registers.show(frame, passing)
        self._before, self._answer = content, passing
        return bytes(passing)

    def _lay(self, datagram: Datagram) -> None:
        data = datagram.place + HEADER_SIZE
        reads, writes = datagram.command is not Command.LWR, datagram.command is not Command.LRD
        count = 0
        for controller in self._controllers:
            has_read = has_written = False
            for part in controller.parts(datagram.logical, datagram.size):
                start, end = data + part.first, data + part.first + part.size
                if part.is_written and writes:
                    self._take(controller, part, start, end)
                    has_written = True
                if part.is_read and reads:
                    self._give(controller, part, start, end)
                    has_read = True
                self.is_plain &= part.is_bytewise
            count += has_read + has_written * (2 if reads else 1)
        self._count(datagram, count)

    def _take(self, controller: Controller, part: LogicalPart, start: int, end: int) -> None:
        guard = _guard(controller, part)
        self.is_plain &= guard is not None and guard.is_written
        self._written.append(_copy(controller, part.place, start, end))

    def _give(self, controller: Controller, part: LogicalPart, start: int, end: int) -> None:
        guard = _guard(controller, part)
        is_register = part.place + part.size <= reg.PROCESS_MEMORY
        self.is_plain &= is_register or (guard is not None and not guard.is_written)
        self._read.append(_copy(controller, part.place, start, end))

    def _show(self, datagram: Datagram) -> None:
        start = datagram.place + HEADER_SIZE
        times = datagram.offset + datagram.size > reg.RECEIVE_TIMES
        self.is_plain &= not (times and datagram.offset < reg.TIME_OFFSET)
        self._shown.append(_Shown(self._controllers, datagram.offset, start, start + datagram.size))
        number = len(self._controllers)
        self._put(datagram.place + 2, (datagram.position + number) & 0xFFFF)
        self._count(datagram, number)

    def _refer(self, datagram: Datagram) -> None:
        first, *others = ((slave, n * HOP) for n, slave in enumerate(self._slaves))
        self.is_plain &= first[0].is_addressed(datagram) and datagram.size == _TIME
        self._references.append(_Reference(*first, others, datagram.place + HEADER_SIZE))
        self._count(datagram, len(self._slaves))

    def _count(self, datagram: Datagram, count: int) -> None:
        self._put(datagram.place + HEADER_SIZE + datagram.size, count)

    def _put(self, place: int, number: int) -> None:
        here = slice(place, place + _COUNTER.size)
        self._counted.append((here, _COUNTER.pack(number)))


def _content(frame: bytes) -> bytes:
    return frame[:_INDEX] + frame[_INDEX + 1 :]


def _copy(controller: Controller, place: int, start: int, end: int) -> _Copy:
    return _Copy(controller.memory, slice(place, place + end - start), slice(start, end))


def _guard(controller: Controller, part: LogicalPart) -> SyncManager | None:
    """Return the sync manager of process data that guards exactly this part."""
    end = part.place + part.size
    found = [m for m in controller.managers if m.is_active and m.start < end]
    found = [m for m in found if part.place < m.start + m.size]
    if len(found) != 1 or found[0].is_mailbox:
        return None
    return found[0] if (found[0].start, found[0].size) == (part.place, part.size) else None
