"""`hil drives reset-faults`: faults of the drives, and their reset with the operator's consent.

A fault has a cause, which is stated first. Only drives in FAULT are written to, and a reset leaves
them in SWITCH ON DISABLED: nothing is energised. Drives powered by another master are left alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.power import Power
from drivers.cia402.states import State, decode_state
from drivers.cia402.supervision import RESET, Supervision
from drivers.commissioning.verdict import Grade, Verdict, grade_check, refused
from drivers.drive_bus import DriveError
from drivers.operator_tools.operator import require_consent

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.drives_file import DrivesFile
    from drivers.operator_tools.operator import Operator
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Fieldbus

_STATE = "state (6041)"


def check_state(server: RemoteDictionary, supervision: Supervision) -> Verdict:
    """Judge the state of a drive; a drive in a fault is refused, with the cause.

    Raises
    ------
    DriveRefused, NodeSilent
        An object cannot be read.
    """
    state = decode_state(server.get(objects.STATUSWORD))
    found = "undefined" if state is None else state.value
    if state is State.FAULT:
        found = f"{found}: {supervision.reason(server)}"
    healthy = state is not State.FAULT
    return grade_check(healthy, Grade.REFUSED, server.label, _STATE, found, "", RESET)


def reset_faults(bus: Fieldbus, drives: DrivesFile, operator: Operator) -> Iterator[Verdict]:
    """Report the fault of each drive; reset faults with the operator's consent.

    Parameters
    ----------
    bus : Fieldbus
        An open bus on which nobody commands the drives.
    drives : DrivesFile
        Axes of the drives.
    operator : Operator
        Consents to the reset.

    Yields
    ------
    Verdict
        State of each drive, then the result of each reset.

    Raises
    ------
    StoppedByOperator
        The operator does not consent; nothing was written.
    """
    unpowered = bus.unpowered(drives)
    supervision = Supervision(unpowered.servers)
    power = Power(unpowered.process_data, unpowered.servers, supervision)
    faulty = []
    for server in unpowered.servers:
        try:
            verdict = check_state(server, supervision)
        except DriveError as error:
            verdict = refused(server.label, _STATE, error)
        else:
            if verdict.grade is Grade.REFUSED:
                verdict = Verdict(Grade.WARNING, verdict.place, verdict.check, verdict.found)
                faulty.append(server)
        yield verdict
    if not faulty:
        return
    labels = ", ".join(server.label for server in faulty)
    require_consent(operator, f"Cause removed: reset the fault of {labels}?")
    for server in faulty:
        try:
            power.make_safe(server, reset_fault=True)
            yield Verdict(Grade.OK, server.label, "reset", "no fault any more, switched off")
        except DriveError as error:
            yield refused(server.label, "reset", error)
