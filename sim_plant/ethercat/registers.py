"""Registers of an EtherCAT slave controller (ETG.1000.4 clause 6), as far as masters use them."""

from __future__ import annotations

import struct

MEMORY_SIZE = 0x3000
"""Registers up to 0FFFh, then 8 KiB of process memory [bytes]."""
PROCESS_MEMORY = 0x1000

INFORMATION = 0x0000
STATION, ALIAS = 0x0010, 0x0012
DL_CONTROL, DL_STATUS = 0x0100, 0x0110
AL_CONTROL, AL_STATUS, AL_CODE = 0x0120, 0x0130, 0x0134
PDI_CONTROL = 0x0140
WATCHDOG_DIVIDER, WATCHDOG_PDI, WATCHDOG_TIME = 0x0400, 0x0410, 0x0420
WATCHDOG_STATUS, WATCHDOG_COUNTER = 0x0440, 0x0442
EEPROM_OWNER, EEPROM_CONTROL, EEPROM_ADDRESS, EEPROM_DATA = 0x0500, 0x0502, 0x0504, 0x0508
FMMU, FMMUS = 0x0600, 8
SYNC_MANAGER, SYNC_MANAGERS = 0x0800, 4
RECEIVE_TIMES, SYSTEM_TIME, RECEIVE_TIME = 0x0900, 0x0910, 0x0918
TIME_OFFSET, TIME_DELAY, TIME_DIFFERENCE = 0x0920, 0x0928, 0x092C
ACTIVATION, START_TIME, SYNC0_CYCLE = 0x0981, 0x0990, 0x09A0

_WRITABLE = (
    (STATION, 2),
    (DL_CONTROL, 4),
    (AL_CONTROL, 2),
    (0x0200, 2),
    (0x0300, 20),
    (WATCHDOG_DIVIDER, 2),
    (WATCHDOG_PDI, 2),
    (WATCHDOG_TIME, 2),
    (WATCHDOG_COUNTER, 2),
    (EEPROM_OWNER, 1),
    (EEPROM_CONTROL, 14),
    (FMMU, 16 * FMMUS),
    *((SYNC_MANAGER + 8 * n, 5) for n in range(SYNC_MANAGERS)),
    *((SYNC_MANAGER + 8 * n + 6, 1) for n in range(SYNC_MANAGERS)),
    (RECEIVE_TIMES, 4),
    (SYSTEM_TIME, 8),
    (TIME_OFFSET, 12),
    (0x0930, 6),
    (0x0980, 2),
    (START_TIME, 8),
    (SYNC0_CYCLE, 8),
)
WRITABLE = frozenset(place for start, size in _WRITABLE for place in range(start, start + size))
"""Addresses below 1000h that a master may write."""

CLEARED = frozenset({*range(0x0300, 0x0314), WATCHDOG_COUNTER, WATCHDOG_COUNTER + 1})
"""Counters, set to zero by any write."""

_FEATURES = 0x0002 | 0x0004 | 0x0008 | 0x0040
"""Features: bit operation of FMMUs (bit 0 is clear); distributed clock of 64 bits with enhanced
activation.
"""


def power_on() -> bytearray:
    """Return the memory of a controller after power-on, before its EEPROM is loaded."""
    memory = bytearray(MEMORY_SIZE)
    ports = 0x0F  # two ports: MII
    struct.pack_into(
        "<BBHBBBBH", memory, INFORMATION, 0x11, 0, 1, FMMUS, SYNC_MANAGERS, 8, ports, _FEATURES
    )
    memory[DL_CONTROL] = 0x01  # frames of other types are destroyed
    struct.pack_into("<H", memory, WATCHDOG_DIVIDER, 2498)
    struct.pack_into("<H", memory, WATCHDOG_PDI, 1000)
    struct.pack_into("<H", memory, WATCHDOG_TIME, 1000)
    memory[WATCHDOG_STATUS] = 1
    return memory
