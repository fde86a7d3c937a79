"""Registers of a slave controller that the driver reads or writes (ETG.1000.4 clause 6)."""

from __future__ import annotations

STATION, ALIAS = 0x0010, 0x0012
AL_CONTROL, AL_STATUS, AL_CODE = 0x0120, 0x0130, 0x0134
WATCHDOG_DIVIDER, WATCHDOG_TIME, WATCHDOG_STATUS = 0x0400, 0x0420, 0x0440
EEPROM_OWNER, EEPROM_CONTROL, EEPROM_ADDRESS, EEPROM_DATA = 0x0500, 0x0502, 0x0504, 0x0508
FMMU, FMMU_SIZE = 0x0600, 16
MANAGER, MANAGER_SIZE = 0x0800, 8
MANAGER_STATUS, MANAGER_ACTIVATE, MANAGER_PDI = 5, 6, 7
"""Places within the registers of a sync manager."""
FULL = 0x08
"""Bit of a sync manager's status: its mailbox waits to be read."""
TICK = 40e-9
"""Unit of the watchdog's divider [s]."""
