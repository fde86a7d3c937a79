"""Supervision of statuswords and emergencies: detection and diagnosis of failed drives.

While axes are powered, each drive must show OPERATION ENABLED. Any other state is a failure; the
diagnosis names axis, state, error code in words and remedy, and may have to read objects. An
emergency (EMCY) of a drive that stays enabled is a warning, to be noted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.error_codes import Emergency, decode_emergency, error_text
from drivers.cia402.states import FAULTS, State, decode_state
from drivers.drive_bus import DriveError, DriveFault
from drivers.remote_dictionary import labels_by_node

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.remote_dictionary import RemoteDictionary

INTERLOCK = 1 << 3
"""Interlock bit of the digital inputs (60FD). Some makers use it for another input, so messages
quote the value; a clear bit proves nothing."""
SAFE_TORQUE_OFF = 0x5441
"""Error code (603F) of an emergency stop contact or safe torque off."""
CODE_SIZE = 2
"""Minimum length of an EMCY: its error code [bytes]."""
RESET = "remove the cause, then reset the fault (hil drives reset-faults)"
"""Remedy for a fault."""


class Supervision:
    """Supervision of emergencies and statuswords.

    Parameters
    ----------
    servers : sequence of RemoteDictionary
        Drives in joint order.

    Attributes
    ----------
    emergency : bool
        True if an emergency has come and may turn out to be a warning.
    """

    def __init__(self, servers: Sequence[RemoteDictionary]) -> None:
        self.emergency = False
        self._servers = servers
        self._emergencies: dict[int, Emergency] = {}
        self._fresh: list[tuple[int, Emergency]] = []
        self._settling: list[tuple[int, Emergency]] = []
        self._told: set[tuple[int, int]] = set()

    def forget(self) -> None:
        """Forget emergencies before power-on."""
        self.emergency = False
        self._emergencies.clear()
        self._fresh.clear()
        self._settling.clear()

    def find_lost(self, statuswords: Sequence[int]) -> int | None:
        """Return the first axis not in OPERATION ENABLED, None if there is none."""
        for axis, word in enumerate(statuswords):
            if decode_state(word) is not State.OPERATION_ENABLED:
                return axis
        return None

    def warnings(self) -> list[str]:
        """Return the emergencies of drives that stayed enabled, each once.

        To be called at every SYNC while `emergency`. A fault may appear in the statusword one SYNC
        after its emergency, so each emergency is held back for one SYNC.
        """
        settled, self._settling, self._fresh = self._settling, self._fresh, []
        self.emergency = bool(self._settling)
        labels = labels_by_node(self._servers)
        found = []
        for node, emergency in settled:
            if (node, emergency.code) not in self._told:
                self._told.add((node, emergency.code))
                found.append(f"{labels[node]}: warning {emergency}; see the drive's manual")
        return found

    def diagnose(self, server: RemoteDictionary, statusword: int) -> DriveError:
        """Describe why a drive is not in OPERATION ENABLED."""
        state = decode_state(statusword)
        if state in FAULTS:
            reason = self.reason(server)
            return DriveFault(f"{server.label}: {state.value}: {reason}; {RESET}")
        shown = f"undefined statusword {statusword:04X}h" if state is None else state.value
        emergency = self._emergencies.get(server.node)
        why = f" after emergency {emergency}" if emergency else ""
        return DriveFault(
            f"{server.label}: left OPERATION ENABLED for {shown}{why}; check emergency stop, safe "
            "torque off and the drive's enable input"
        )

    def reason(self, server: RemoteDictionary) -> str:
        """Return the reason of a fault: the last emergency, otherwise 603F or 1003."""
        emergency = self._emergencies.get(server.node)
        if emergency is not None:
            return str(emergency)
        try:
            code = server.find(objects.ERROR_CODE)
            if code is None:
                code = server.find(objects.ERROR_HISTORY)
        except DriveError:
            code = None
        return "the drive does not say why" if code is None else error_text(code & 0xFFFF)

    def take_emergency(self, node: int, data: bytes) -> None:
        """Record an emergency of a drive, or the end of its error."""
        if len(data) < CODE_SIZE:
            return  # neither an error nor the end of an error
        emergency = decode_emergency(data)
        if emergency.code & 0xFF00:
            self._emergencies[node] = emergency
            self._fresh.append((node, emergency))
            self.emergency = True
        else:
            self._emergencies.pop(node, None)


def safe_torque_off(server: RemoteDictionary) -> str | None:
    """Return the evidence of active safe torque off in words; None if absent.

    Never raises a `DriveError`, since it is called after another failure.
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
    """Return the evidence of an interlock in the digital inputs (60FD); None if absent."""
    if not inputs & INTERLOCK:
        return None
    return f"safe torque off is active (60FD = {inputs:08X}h: bit 3, interlock)"
