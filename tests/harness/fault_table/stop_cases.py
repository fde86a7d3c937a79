"""Failing stops: outages of transmitting or receiving, and disobedient drives.

Every outage comes with Ctrl-C in a stroke, in a stroke on its own, and with the third axis's
command to enable operation.
"""

from __future__ import annotations

import struct
from functools import partial
from typing import TYPE_CHECKING, Any

from drivers.canopen.network import SEND_ATTEMPTS
from drivers.canopen.pdo_mapping import received
from drivers.cia402.states import Command
from drivers.drive_bus import BusUnavailable, NodeSilent
from drivers.safety.trips import BLIND
from fault_table import signs
from fault_table.case import Case, everywhere, fault
from fault_table.trial import FAST, FAST_AXIS, drives
from sim_plant.faults.fault_plan import Span, What, When

if TYPE_CHECKING:
    from collections.abc import Iterator

    import can

    from sim_plant.faults.fault_plan import Fault

SECOND_STROKE = When(set_point=8, after=0.3)
"""Set-point count in the second stroke: all six axes move to the start before the strokes."""
FULL_SPEED = When(set_point=3, after=0.4)
LENGTHS = (0.010, 0.025, 0.040, 0.060, 0.090, 0.120, 0.200)
"""Durations of outages [s]."""
WAY, OFF_WITHIN = 1.0, 0.5
"""Bounds for a drive that keeps its speed of 2.4 rad/s [rad, s]."""
WATCHDOG_WITHIN = 1.5
"""Time until a drive that keeps its voltage is off: stop, switch-off attempts, heartbeat time-out
[s].
"""

_RPDO = struct.Struct("<iH")
_ENABLE = (received(drives.axes[2]).cob_id, Command.ENABLE_OPERATION.value[0])
_STOPS_AGAIN = "repeats the command to stop at every SYNC"
_STOPS = "stops"


def powering_up(frame: can.Message) -> bool:
    """Return True if a frame commands axis 3 to enable operation; two are on already."""
    if frame.arbitration_id != _ENABLE[0]:
        return False
    return bool(_RPDO.unpack(frame.data)[1] == _ENABLE[1])


def _outages(what: What) -> Iterator[Case]:
    for length in LENGTHS:
        yield _interruption(what, length)
    for length in LENGTHS:
        yield _stroke_case(what, length)
    for length in LENGTHS:
        yield _power_up_case(what, length)


def _names(what: What, length: float, moment: str) -> dict[str, Any]:
    """Return the name of the case, and of its kind with a placeholder for the durations."""
    named = f"{what.replace('-', ' ')} of {{}} ms {moment}"
    return {"name": named.format(f"{1000 * length:.0f}"), "kind": named}


def _interruption(what: What, length: float) -> Case:
    return Case(
        does=_STOPS_AGAIN, faults=(everywhere(what, SECOND_STROKE, Span(time=length)),),
        error=KeyboardInterrupt, reads="", interrupted=True, outage=length,
        **_names(what, length, "at Ctrl-C"),
    )  # fmt: skip


def _stroke_case(what: What, length: float) -> Case:
    case = partial(
        Case, faults=(everywhere(what, SECOND_STROKE, Span(time=length)),), outage=length,
        **_names(what, length, "in a stroke"),
    )  # fmt: skip
    syncs = round(length / drives.sync_period)
    if what is What.TRANSMIT_OUTAGE:
        if syncs < SEND_ATTEMPTS:
            does = f"sends again and continues, or {_STOPS}"
            return case(does=does, error=BusUnavailable, reads="", may_go_on=True)
        return case(does=_STOPS, error=BusUnavailable, reads="cannot be sent")
    if syncs < BLIND:
        return case(does="flags the samples", error=None, reads="", flags=True)
    return case(
        does=f"flags the samples; after {BLIND} in a row {_STOPS}", error=NodeSilent,
        reads="no TPDO for 10 SYNCs in a row", shown=signs.blindness, flags=True,
    )  # fmt: skip


def _power_up_case(what: What, length: float) -> Case:
    case = partial(
        Case, faults=(everywhere(what, When(time=0), Span(time=length)),), outage=length,
        condition=powering_up, **_names(what, length, "in powering up"),
    )  # fmt: skip
    if what is What.TRANSMIT_OUTAGE:
        return case(
            does="switches off", error=BusUnavailable, reads="cannot be sent", energised=None
        )
    return case(does="waits for the drives and continues", error=None, reads="")


def _disobedient(what: What) -> tuple[Fault]:
    return (fault(what, FULL_SPEED, axis=FAST_AXIS),)


STOP_CASES = (
    *_outages(What.TRANSMIT_OUTAGE),
    *_outages(What.RECEIVE_OUTAGE),
    Case(
        "quick stop ignored, Ctrl-C at 2.4 rad/s", "disables voltage",
        _disobedient(What.QUICK_STOP_IGNORED), KeyboardInterrupt, "", signs.event,
        plan=FAST, interrupted=True, way=WAY, off_within=OFF_WITHIN,
    ),
    Case(
        "quick stop shown, axis continues, Ctrl-C at 2.4 rad/s", "disables voltage",
        _disobedient(What.STOP_WITHOUT_EFFECT), KeyboardInterrupt, "",
        signs.event, plan=FAST, interrupted=True, way=WAY, off_within=OFF_WITHIN,
    ),
    Case(
        "disable voltage ignored, Ctrl-C at 2.4 rad/s",
        "ends the heartbeat; the drive then switches off",
        _disobedient(What.DISABLE_VOLTAGE_IGNORED),
        KeyboardInterrupt, "joint 1 (node 1)", signs.event, plan=FAST, interrupted=True,
        off_within=WATCHDOG_WITHIN,
    ),
)  # fmt: skip
