"""Registers of a slave controller (ETG.1000.4 clause 6), AL states and error codes (ETG.1020)."""

from __future__ import annotations

import enum

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


ERROR = ACKNOWLEDGE = 0x10
"""Error bit of AL status (change refused, or state left); bit of AL control that clears the
error."""
MASK = 0x0F

_CODES = {
    0x0001: "unspecified error",
    0x0002: "no memory",
    0x0003: "invalid device set-up",
    0x0011: "invalid requested state change",
    0x0012: "unknown requested state",
    0x0013: "bootstrap not supported",
    0x0014: "no valid firmware",
    0x0016: "invalid mailbox configuration",
    0x0017: "invalid sync manager configuration",
    0x0018: "no valid inputs available",
    0x0019: "no valid outputs",
    0x001A: "synchronization error",
    0x001B: "sync manager watchdog",
    0x001C: "invalid sync manager types",
    0x001D: "invalid output configuration",
    0x001E: "invalid input configuration",
    0x001F: "invalid watchdog configuration",
    0x0020: "needs a cold start",
    0x0021: "needs INIT",
    0x0022: "needs PREOP",
    0x0023: "needs SAFEOP",
    0x0024: "invalid input mapping",
    0x0025: "invalid output mapping",
    0x0026: "inconsistent settings",
    0x0027: "free run not supported",
    0x0028: "synchronization mode not supported",
    0x0029: "free run needs three buffers",
    0x002A: "watchdog of the application",
    0x002B: "no valid inputs and outputs",
    0x002C: "fatal synchronization error",
    0x002D: "no synchronization signal (SYNC0)",
    0x0030: "invalid configuration of the distributed clock",
    0x0032: "PLL error of the distributed clock",
    0x0033: "DC sync I/O error",
    0x0034: "DC sync timeout: SYNC events missed",
    0x0035: "invalid cycle time",
    0x0036: "invalid SYNC0 cycle",
    0x0037: "invalid SYNC1 cycle",
    0x0042: "error of EoE",
    0x0050: "EEPROM cannot be accessed",
    0x0051: "error in the EEPROM",
    0x0060: "restarted locally",
    0x0061: "device identification updated",
}


class AlState(enum.IntEnum):
    """AL states, as in the registers."""

    INIT = 1
    PREOP = 2
    BOOT = 3
    SAFEOP = 4
    OP = 8


def describe(status: int, code: int = 0) -> str:
    """Return AL status and status code in words."""
    try:
        state = AlState(status & MASK).name
    except ValueError:
        state = f"AL state {status & MASK:X}h"
    if not status & ERROR:
        return state
    why = _CODES.get(code, "of the maker's own" if code >= 0x8000 else "unknown")
    return f"{state} with error {code:04X}h ({why})"
