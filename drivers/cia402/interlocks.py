"""Whether something outside the bus keeps a drive from energising its motor.

A drive whose safe torque off is active stays in SWITCH ON DISABLED whatever it is commanded, and no
state says why. CiA 402 has a place for it: bit 3 of the digital inputs (60FD), interlock. Not every
drive has the object, and some makers keep the bit for another input; so what is read is quoted, and
a bit that is clear proves nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.drive_bus import DriveError

if TYPE_CHECKING:
    from drivers.fieldbus import Objects

INTERLOCK = 1 << 3
SAFE_TORQUE_OFF = 0x5441
"""Error code (603F) of an emergency stop contact or safe torque off."""


def safe_torque_off(server: Objects) -> str | None:
    """Return that safe torque off is active and what says so; None where nothing does.

    Never raises a `DriveError`: it is asked when something else has failed already.
    """
    try:
        inputs = server.find(objects.DIGITAL_INPUTS)
        error = server.find(objects.ERROR_CODE)
    except DriveError:
        return None
    if error == SAFE_TORQUE_OFF:
        return f"safe torque off is active (603F = {error:04X}h)"
    return None if inputs is None else interlock(inputs)


def interlock(inputs: int) -> str | None:
    """Return what the digital inputs (60FD) say of an interlock; None where they say nothing."""
    if not inputs & INTERLOCK:
        return None
    return f"safe torque off is active (60FD = {inputs:08X}h: bit 3, interlock)"
