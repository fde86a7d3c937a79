"""Registers of a slave controller used by the driver (ETG.1000.4 clause 6)."""

from __future__ import annotations

FEATURES, STATION, ALIAS = 0x0008, 0x0010, 0x0012
DL_STATUS = 0x0110
AL_CONTROL, AL_STATUS, AL_CODE = 0x0120, 0x0130, 0x0134
WATCHDOG_DIVIDER, WATCHDOG_TIME, WATCHDOG_STATUS = 0x0400, 0x0420, 0x0440
EEPROM_OWNER, EEPROM_CONTROL, EEPROM_ADDRESS, EEPROM_DATA = 0x0500, 0x0502, 0x0504, 0x0508
FMMU, FMMU_SIZE = 0x0600, 16
MANAGER, MANAGER_SIZE = 0x0800, 8
MANAGER_STATUS, MANAGER_ACTIVATE, MANAGER_PDI = 5, 6, 7
"""Offsets within the registers of a sync manager."""
RECEIVE_TIMES, SYSTEM_TIME, RECEIVE_TIME = 0x0900, 0x0910, 0x0918
TIME_OFFSET, TIME_DELAY, TIME_DIFFERENCE, SPEED_START = 0x0920, 0x0928, 0x092C, 0x0930
ACTIVATION, SYNC0_START, SYNC0_CYCLE = 0x0980, 0x0990, 0x09A0
"""Registers of the distributed clock."""
FULL = 0x08
"""Status bit of a sync manager: its mailbox is full."""
TICK = 40e-9
"""Unit of the watchdog's divider [s]."""
