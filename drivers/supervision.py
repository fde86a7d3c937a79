"""Judging statuswords and emergencies: is every drive still with us, and if not, why not.

While axes are powered, each drive must show OPERATION ENABLED. Anything else, and any emergency
object (EMCY), is trouble; the judgement names axis, state, error code in words and remedy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers import objects
from drivers.cia402 import State, decode_state
from drivers.drive_bus import DriveError, DriveFault
from drivers.error_codes import Emergency, decode_emergency, error_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.network import PumpedNetwork
    from drivers.sdo import SdoServer

_FAULTS = frozenset({State.FAULT, State.FAULT_REACTION_ACTIVE})


class Supervision:
    """Listens for emergencies and judges statuswords.

    Parameters
    ----------
    network : PumpedNetwork
        Where emergencies are heard.
    servers : sequence of SdoServer
        The drives in joint order.

    Attributes
    ----------
    emergency : bool
        An emergency has come that has not gone.
    """

    def __init__(self, network: PumpedNetwork, servers: Sequence[SdoServer]) -> None:
        self.emergency = False
        self._servers = servers
        self._emergencies: dict[int, Emergency] = {}
        for server in servers:
            network.subscribe(0x80 + server.node, self._on_emergency)

    def forget(self) -> None:
        """Forget emergencies of the time before the drives were switched on."""
        self.emergency = False
        self._emergencies.clear()

    def judge(self, statuswords: Sequence[int]) -> DriveError | None:
        """Return what is wrong with powered drives, None if nothing is."""
        for server, word in zip(self._servers, statuswords, strict=True):
            state = decode_state(word)
            if state is not State.OPERATION_ENABLED:
                return self.diagnose(server, word)
        for server in self._servers:
            emergency = self._emergencies.get(server.node)
            if emergency is not None:
                return DriveFault(f"{server.label}: emergency {emergency}; see the drive's manual")
        return None

    def diagnose(self, server: SdoServer, statusword: int) -> DriveError:
        """Put into words why a drive is not in OPERATION ENABLED."""
        state = decode_state(statusword)
        if state in _FAULTS:
            reason = self.reason(server)
            return DriveFault(
                f"{server.label}: {state.value}: {reason}; remove the cause, then reset the fault"
            )
        shown = f"undefined statusword {statusword:04X}h" if state is None else state.value
        emergency = self._emergencies.get(server.node)
        why = f" after emergency {emergency}" if emergency else ""
        return DriveFault(
            f"{server.label}: left OPERATION ENABLED for {shown}{why}; check emergency stop, safe "
            "torque off and the drive's enable input"
        )

    def reason(self, server: SdoServer) -> str:
        """Return a fault's reason: the last emergency, else what 603F or 1003 says."""
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

    def _on_emergency(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del timestamp
        emergency = decode_emergency(data)
        if emergency.code & 0xFF00:
            self._emergencies[can_id - 0x80] = emergency
        else:
            self._emergencies.pop(can_id - 0x80, None)
        self.emergency = bool(self._emergencies)
