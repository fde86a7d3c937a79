"""COB-IDs: a CAN identifier with flags, and the rules for changing one (CiA 301).

Bit 31 switches the service off, bit 30 belongs to the service, bit 29 asks for 29-bit identifiers,
which our drives do not have. While a service is on, its identifier cannot be changed: off, change,
on.
"""

from __future__ import annotations

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort

INVALID = 1 << 31
FLAG = 1 << 30
IDENTIFIER = 0x7FF

_RESTRICTED = (
    range(0x080),
    range(0x101, 0x181),
    range(0x581, 0x600),
    range(0x601, 0x680),
    range(0x6E0, 0x800),
)
"""Identifiers that no configurable service may use (CiA 301, table 41)."""


def check_change(old: int, new: int) -> None:
    """Check a change of a COB-ID against the rules of CiA 301.

    Raises
    ------
    SdoAbort
        INVALID_VALUE
    """
    if new & ~(INVALID | FLAG | IDENTIFIER):
        raise SdoAbort(AbortCode.INVALID_VALUE)
    if new & INVALID:
        return
    identifier = new & IDENTIFIER
    if any(identifier in forbidden for forbidden in _RESTRICTED):
        raise SdoAbort(AbortCode.INVALID_VALUE)
    if not old & INVALID and identifier != old & IDENTIFIER:
        raise SdoAbort(AbortCode.INVALID_VALUE)
