"""EtherCAT slave controller: memory, access rights, and logical addresses.

A sync manager guards a part of the process memory. In mailbox mode the part is full or empty:
written while empty and read while full, and access to its last byte changes between the two. In
buffered mode (process data) both sides have access at any time. FMMUs map parts of the memory, to
the bit, into the logical memory shared by all slaves.

Effects of a frame (mailbox, state request, EEPROM command) occur after its passage: `take_events`.
Masters therefore find nothing answered in the same frame, as in hardware.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from sim_plant.ethercat import registers as reg
from sim_plant.ethercat.frame import BROADCAST, LOGICAL, Datagram

_FMMU = struct.Struct("<IHBBHBBB")
_SYNC_MANAGER = struct.Struct("<HHBBBB")
_FULL = 0x08
_STATUS = tuple(reg.SYNC_MANAGER + 8 * number + 5 for number in range(reg.SYNC_MANAGERS))
"""Addresses of the status of the sync managers."""
_READ, _WRITE = 1, 2
_WHOLE_BYTES = 0, 7, 0


class SyncManager(NamedTuple):
    """Sync manager: a part of the process memory and its access by the master."""

    start: int
    size: int
    control: int
    status: int
    activate: int
    pdi: int

    @property
    def is_active(self) -> bool:
        """True if the sync manager guards a part of the memory."""
        return bool(self.activate & 1) and self.size > 0

    @property
    def is_mailbox(self) -> bool:
        """True for mailbox mode."""
        return self.control & 0x03 == 0x02

    @property
    def is_written(self) -> bool:
        """True if the master writes the part and the slave reads it."""
        return self.control & 0x0C == 0x04

    @property
    def feeds_watchdog(self) -> bool:
        """True if a write triggers the watchdog of process data."""
        return bool(self.control & 0x40)


class LogicalPart(NamedTuple):
    """Part of a slave's memory in a logical datagram.

    Attributes
    ----------
    place, first, size : int
        Start in memory and in the datagram's data, and length [bytes].
    is_written, is_read : bool
        Access by the master.
    is_bytewise : bool
        True if the part consists of whole bytes.
    """

    place: int
    first: int
    size: int
    is_written: bool
    is_read: bool
    is_bytewise: bool


class _Fmmu(NamedTuple):
    """FMMU: a part of memory mapped into logical memory."""

    logical: int
    size: int
    physical: int
    kind: int
    is_bytewise: bool
    start_bit: int
    stop_bit: int
    physical_bit: int


class Controller:
    """Memory of a slave, as accessed by the master.

    Attributes
    ----------
    memory : bytearray
        Registers and process memory; the slave's own side writes it directly.
    set_up : list of SyncManager, or None
        Present settings of all sync managers, a new list after every change; None while outdated.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self.memory = reg.power_on()
        self._events: set[int] = set()
        self.set_up: list[SyncManager] | None = None
        self._active: list[tuple[int, SyncManager, int]] = []
        self._fmmus: list[_Fmmu] = []

    # Access by the firmware

    def word(self, place: int) -> int:
        """Return a register of 16 bits."""
        return int.from_bytes(self.memory[place : place + 2], "little")

    def put(self, place: int, size: int, value: int) -> None:
        """Write a value to a register, least significant byte first."""
        self.memory[place : place + size] = value.to_bytes(size, "little")

    @property
    def managers(self) -> list[SyncManager]:
        """Sync managers in the present configuration."""
        if self.set_up is None:
            self._load()
        return self.set_up or []

    def parts(self, logical: int, size: int) -> list[LogicalPart]:
        """Return the parts of memory in a logical datagram."""
        if self.set_up is None:
            self._load()
        found = [(fmmu, _overlap(fmmu, logical, size)) for fmmu in self._fmmus]
        return [
            LogicalPart(*place, bool(fmmu.kind & _WRITE), bool(fmmu.kind & _READ), fmmu.is_bytewise)
            for fmmu, place in found
            if place[2] > 0
        ]

    def _load(self) -> None:
        """Load the configuration of sync managers and FMMUs; empty the mailboxes switched off."""
        self.set_up = [
            SyncManager(*_SYNC_MANAGER.unpack_from(self.memory, reg.SYNC_MANAGER + 8 * n))
            for n in range(reg.SYNC_MANAGERS)
        ]
        self._active = []
        for number, guarded in enumerate(self.set_up):
            if guarded.is_active:
                self._active.append((number, guarded, guarded.start + guarded.size))
            else:
                self.set_full(number, full=False)
        self._fmmus = []
        for number in range(reg.FMMUS):
            logical, size, first, last, physical, shift, kind, active = _FMMU.unpack_from(
                self.memory, reg.FMMU + 16 * number
            )
            if active & 1 and size:
                bits = first & 7, last & 7, shift & 7
                self._fmmus.append(
                    _Fmmu(logical, size, physical, kind, bits == _WHOLE_BYTES, *bits)
                )

    def is_full(self, manager: int) -> bool:
        """Return True if a mailbox waits to be read."""
        return bool(self.memory[_STATUS[manager]] & _FULL)

    def set_full(self, manager: int, *, full: bool) -> None:
        """Mark a mailbox as full or empty."""
        status = self.memory[_STATUS[manager]]
        self.memory[_STATUS[manager]] = status | _FULL if full else status & ~_FULL

    def acknowledge_repeat(self, manager: int, bit: int) -> None:
        """Acknowledge a request to repeat a mailbox."""
        place = reg.SYNC_MANAGER + 8 * manager + 7
        self.memory[place] = self.memory[place] & ~0x02 | bit
        self.set_up = None

    def content(self, manager: int) -> bytes:
        """Return the content of a sync manager's part."""
        guarded = self.managers[manager]
        return bytes(self.memory[guarded.start : guarded.start + guarded.size])

    def take_events(self) -> set[int]:
        """Return and clear the start addresses of registers and parts written, or read empty."""
        events, self._events = self._events, set()
        return events

    # Access by datagrams

    def serve(self, datagram: Datagram, *, reads: bool, writes: bool) -> None:
        """Process a datagram for this slave and increment the working counter."""
        if datagram.command in LOGICAL:
            self._serve_logical(datagram, reads=reads, writes=writes)
            return
        found = self.read(datagram.offset, datagram.size) if reads else None
        if writes and self.write(datagram.offset, datagram.data):
            datagram.count(2 if reads else 1)
        if found is not None:
            if datagram.command in BROADCAST:
                found = bytes(a | b for a, b in zip(datagram.data, found, strict=True))
            datagram.data = found
            datagram.count(1)

    def read(self, place: int, size: int) -> bytes | None:
        """Return a part of memory; None if it is not accessible now."""
        end = place + size
        if end > reg.MEMORY_SIZE or not size:
            return None
        if end > reg.PROCESS_MEMORY:
            for number, guarded, last in self._guards(place, end):
                if guarded.is_written or (guarded.is_mailbox and not self.is_full(number)):
                    return None
                if guarded.is_mailbox and end >= last:
                    self.set_full(number, full=False)
                self._events.add(guarded.start)
        return bytes(self.memory[place:end])

    def write(self, place: int, data: bytes) -> bool:
        """Write a part of memory; return True if any byte was accepted."""
        end = place + len(data)
        if end > reg.MEMORY_SIZE or not data:
            return False
        if place < reg.PROCESS_MEMORY:
            return self._write_registers(place, data)
        for number, guarded, last in self._guards(place, end):
            if not guarded.is_written or (guarded.is_mailbox and self.is_full(number)):
                return False
            if end >= last:
                if guarded.is_mailbox:
                    self.set_full(number, full=True)
                self._events.add(guarded.start)
        self.memory[place:end] = data
        return True

    def _guards(self, place: int, end: int) -> list[tuple[int, SyncManager, int]]:
        """Return number, sync manager and end of all guards of a part of memory."""
        if self.set_up is None:
            self._load()
        return [found for found in self._active if found[1].start < end and place < found[2]]

    def _write_registers(self, place: int, data: bytes) -> bool:
        taken = False
        for at, value in enumerate(data, start=place):
            if at in reg.WRITABLE:
                self.memory[at] = 0 if at in reg.CLEARED else value
                self._events.add(at)
                taken = True
        self.set_up = None
        return taken

    def _serve_logical(self, datagram: Datagram, *, reads: bool, writes: bool) -> None:
        if self.set_up is None:
            self._load()
        incoming, outgoing = datagram.data, bytearray(datagram.data)
        done = 0
        for fmmu in self._fmmus:
            if writes and fmmu.kind & _WRITE and self._lay_out(fmmu, datagram.logical, incoming):
                done |= _WRITE
            if reads and fmmu.kind & _READ and self._lay_in(fmmu, datagram.logical, outgoing):
                done |= _READ
        if done & _READ:
            datagram.data = bytes(outgoing)
        datagram.count((done & _READ) + (done >> 1) * (2 if reads else 1))

    def _lay_out(self, fmmu: _Fmmu, start: int, data: bytes) -> bool:
        """Write the data of a logical datagram to memory."""
        place, first, size = _overlap(fmmu, start, len(data))
        if size <= 0:
            return False
        if fmmu.is_bytewise:
            return self.write(place, data[first : first + size])
        value, shift, mask = int.from_bytes(data[first : first + size], "little"), *_bits(fmmu)
        covered = _covered(fmmu)
        present = int.from_bytes(self.memory[fmmu.physical : fmmu.physical + covered], "little")
        moved = (value >> fmmu.start_bit & mask) << shift
        merged = present & ~(mask << shift) | moved
        return size == fmmu.size and self.write(
            fmmu.physical, (merged & (1 << 8 * covered) - 1).to_bytes(covered, "little")
        )

    def _lay_in(self, fmmu: _Fmmu, start: int, data: bytearray) -> bool:
        """Read data from memory into a logical datagram."""
        place, first, size = _overlap(fmmu, start, len(data))
        if size <= 0 or (size != fmmu.size and not fmmu.is_bytewise):
            return False
        if fmmu.is_bytewise:
            found = self.read(place, size)
        else:
            found = self.read(fmmu.physical, _covered(fmmu))
        if found is None:
            return False
        if not fmmu.is_bytewise:
            shift, mask = _bits(fmmu)
            value = int.from_bytes(data[first : first + size], "little")
            bits = int.from_bytes(found, "little") >> shift & mask
            value = value & ~(mask << fmmu.start_bit) | bits << fmmu.start_bit
            found = value.to_bytes(size, "little")
        data[first : first + size] = found
        return True


def _overlap(fmmu: _Fmmu, start: int, size: int) -> tuple[int, int, int]:
    """Return physical address, place in the datagram and size of an overlap [bytes]."""
    low, high = max(fmmu.logical, start), min(fmmu.logical + fmmu.size, start + size)
    return fmmu.physical + low - fmmu.logical, low - start, high - low


def _bits(fmmu: _Fmmu) -> tuple[int, int]:
    """Return the shift of the bits in memory, and their unshifted mask."""
    width = 8 * (fmmu.size - 1) + fmmu.stop_bit - fmmu.start_bit + 1
    return fmmu.physical_bit, (1 << max(width, 0)) - 1


def _covered(fmmu: _Fmmu) -> int:
    """Return the number of bytes in memory covered by the bits of an FMMU."""
    shift, mask = _bits(fmmu)
    return max(1, (shift + mask.bit_length() + 7) // 8)
