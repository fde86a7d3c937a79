"""EEPROM of a slave (SII, ETG.1000.6 clause 5.4 and ETG.2010) and its access by the master."""

from __future__ import annotations

import enum
import struct
from typing import TYPE_CHECKING

from sim_plant.ethercat import registers as reg

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from sim_plant.ethercat.controller import Controller
    from sim_plant.ethercat.objects import DriveObjects, Pdo

SIZE = 4096
"""Size in bytes; the EEPROM states kibibits less 1."""
ALIAS_WORD = 4
MAILBOX_SIZE = 512
MAILBOX_OUT, MAILBOX_IN, OUTPUTS, INPUTS = 0x1000, 0x1400, 0x1800, 0x1C00
"""Start addresses of the four parts of the process memory."""
CONTROLS = (0x26, 0x22, 0x64, 0x20)
"""Control bytes of the sync managers: mailbox out and in, outputs with watchdog, inputs."""
CONFIGURATION = (0x0C05, 0x0000)
"""Words 0 and 1: interface to a microcontroller."""
SYNC0_ACTIVATION = 0x0300
"""Assign-activate word: cyclic operation, SYNC0."""

_COE = 1 << 2
_COE_DETAILS = 0x2F
"""SDO, SDO information, PDO assignment, PDO configuration, complete access."""
_READS_EIGHT, _WRITE_ENABLE = 0x40, 0x01
_READ, _WRITE, _RELOAD = 1, 2, 4
_NO_ACKNOWLEDGE, _NOT_ENABLED = 0x2000, 0x4000


class _Category(enum.IntEnum):
    STRINGS = 10
    GENERAL = 30
    FMMU = 40
    SYNC_MANAGER = 41
    TXPDO = 50
    RXPDO = 51
    CLOCK = 60


class Eeprom:
    """Non-volatile content, and the commands of registers 0500h to 050Fh.

    Parameters
    ----------
    content : bytes
    """

    def __init__(self, content: bytes) -> None:
        self._content = bytearray(content.ljust(SIZE, b"\xff"))

    def load(self, controller: Controller) -> None:
        """Load a controller's start values: kind of interface and alias."""
        start = 2 * ALIAS_WORD
        controller.memory[reg.PDI_CONTROL : reg.PDI_CONTROL + 2] = self._content[:2]
        controller.memory[reg.ALIAS : reg.ALIAS + 2] = self._content[start : start + 2]
        controller.put(reg.EEPROM_CONTROL, 2, _READS_EIGHT)

    @property
    def alias(self) -> int:
        """Configured station alias, valid from the next power-on."""
        return int.from_bytes(self._content[2 * ALIAS_WORD : 2 * ALIAS_WORD + 2], "little")

    @alias.setter
    def alias(self, alias: int) -> None:
        struct.pack_into("<H", self._content, 2 * ALIAS_WORD, alias)
        self._content[14] = _checksum(self._content[:14])

    def execute(self, controller: Controller) -> None:
        """Execute the command written by the master, if the master owns the EEPROM."""
        control = controller.word(reg.EEPROM_CONTROL)
        command, failure = control >> 8 & 0x07, 0
        start = 2 * int.from_bytes(
            controller.memory[reg.EEPROM_ADDRESS : reg.EEPROM_ADDRESS + 4], "little"
        )
        if controller.memory[reg.EEPROM_OWNER] & 0x01:
            failure = _NO_ACKNOWLEDGE
        elif command == _READ:
            found = self._content[start : start + 8].ljust(8, b"\xff")
            controller.memory[reg.EEPROM_DATA : reg.EEPROM_DATA + 8] = found
        elif command == _WRITE and not control & _WRITE_ENABLE:
            failure = _NOT_ENABLED
        elif command == _WRITE and start + 2 <= SIZE:
            written = controller.memory[reg.EEPROM_DATA : reg.EEPROM_DATA + 2]
            self._content[start : start + 2] = written
        elif command not in (0, _RELOAD):
            failure = _NO_ACKNOWLEDGE
        controller.put(reg.EEPROM_CONTROL, 2, _READS_EIGHT | failure)


def sii(objects: DriveObjects, identity: Sequence[int], name: str) -> bytes:
    """Return the content of a drive's EEPROM.

    Parameters
    ----------
    objects : DriveObjects
        Data sheet of the drive, for its process data after power-on.
    identity : sequence of int
        Vendor, product code, revision, serial number.
    name : str
        Name of the drive.
    """
    head = bytearray(2 * 0x40)
    struct.pack_into("<HH", head, 0, *CONFIGURATION)
    head[14] = _checksum(head[:14])
    struct.pack_into("<4I", head, 2 * 0x08, *identity)
    struct.pack_into("<4H", head, 2 * 0x18, MAILBOX_OUT, MAILBOX_SIZE, MAILBOX_IN, MAILBOX_SIZE)
    struct.pack_into("<H", head, 2 * 0x1C, _COE)
    struct.pack_into("<HH", head, 2 * 0x3E, SIZE // 128 - 1, 1)
    strings = [name, "Drives"]
    received, sent = objects.assigned(0x1C12), objects.assigned(0x1C13)
    sizes = (MAILBOX_SIZE, MAILBOX_SIZE, _size(received), _size(sent))
    starts = (MAILBOX_OUT, MAILBOX_IN, OUTPUTS, INPUTS)
    managers = b"".join(
        struct.pack("<HHBBBB", start, size, control, 0, 1, kind)
        for kind, (start, size, control) in enumerate(zip(starts, sizes, CONTROLS, strict=True), 1)
    )
    general = struct.pack("<5B B 5x B 20x", 2, 0, 1, 1, 0, _COE_DETAILS, 0)
    clock = struct.pack("<IIIhHhBB4x", 0, 0, 0, 0, SYNC0_ACTIVATION, 0, 0, 0)
    return bytes(head) + b"".join(
        (
            _category(_Category.STRINGS, _strings(strings)),
            _category(_Category.GENERAL, general),
            _category(_Category.FMMU, bytes((1, 2, 3, 0))),
            _category(_Category.SYNC_MANAGER, managers),
            _category(_Category.TXPDO, b"".join(_pdo(pdo, 3) for pdo in sent)),
            _category(_Category.RXPDO, b"".join(_pdo(pdo, 2) for pdo in received)),
            _category(_Category.CLOCK, clock),
            b"\xff\xff",
        )
    )


def _size(pdos: Iterable[Pdo]) -> int:
    return sum(pdo.size for pdo in pdos)


def _pdo(pdo: Pdo, manager: int) -> bytes:
    head = struct.pack("<HBBBBH", pdo.index, len(pdo.entries), manager, 0, 0, 0)
    return head + b"".join(
        struct.pack("<HBBBBH", entry.index, entry.subindex, 0, entry.data_type, 8 * entry.size, 0)
        for entry in pdo.entries
    )


def _category(kind: _Category, data: bytes) -> bytes:
    data += bytes(len(data) % 2)
    return struct.pack("<HH", kind, len(data) // 2) + data


def _strings(texts: Sequence[str]) -> bytes:
    coded = [text.encode("ascii", "replace")[:255] for text in texts]
    return bytes([len(coded)]) + b"".join(bytes([len(text)]) + text for text in coded)


def _checksum(words: bytes | bytearray) -> int:
    """Return the CRC-8 of the configuration area: polynomial 07h, initial value FFh (ETG.2010)."""
    crc = 0xFF
    for byte in words:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07) & 0xFF if crc & 0x80 else crc << 1
    return crc
