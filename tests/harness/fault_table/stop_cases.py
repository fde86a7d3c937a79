"""Stops that go wrong: outages of transmitting or receiving, and drives that disobey.

Every outage comes with Ctrl-C in a stroke, in a stroke on its own, and with the third axis's
command to enable operation.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

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
"""Of any axis: all six travel to the start, then the measured axis has its strokes."""
FULL_SPEED = When(set_point=3, after=0.4)
LENGTHS = (0.010, 0.025, 0.040, 0.060, 0.090, 0.120, 0.200)
"""[s]."""
WAY, OFF_WITHIN = 1.0, 0.5
"""What a drive at 2.4 rad/s that does not slow down may come to [rad, s]."""
WATCHDOG_WITHIN = 1.5
"""Until a drive that keeps its voltage is off: stop, attempts to switch it off, heartbeat's
time-out [s]."""

_RPDO = struct.Struct("<iH")
_ENABLE = (received(drives.axes[2]).cob_id, Command.ENABLE_OPERATION.value[0])
_STOPS_AGAIN = "commands all to stop at every SYNC until they do, and switches them off"
_STOPS = "stops all axes and switches them off"


def powering_up(frame: can.Message) -> bool:
    """Whether a frame commands the third axis to enable operation; two were commanded before."""
    if frame.arbitration_id != _ENABLE[0]:
        return False
    return bool(_RPDO.unpack(frame.data)[1] == _ENABLE[1])


def _outages(what: What) -> Iterator[Case]:
    for length in LENGTHS:
        yield _at_interruption(what, length)
    for length in LENGTHS:
        yield _in_a_stroke(what, length)
    for length in LENGTHS:
        yield _in_powering_up(what, length)


def _name(what: What, length: float) -> str:
    return f"{what.replace('-', ' ')} of {1000 * length:.0f} ms"


def _at_interruption(what: What, length: float) -> Case:
    return Case(
        f"{_name(what, length)} at Ctrl-C", _STOPS_AGAIN,
        (everywhere(what, SECOND_STROKE, Span(time=length)),), KeyboardInterrupt, "",
        interrupted=True, outage=length,
    )  # fmt: skip


def _in_a_stroke(what: What, length: float) -> Case:
    faults = (everywhere(what, SECOND_STROKE, Span(time=length)),)
    name, syncs = f"{_name(what, length)} in a stroke", round(length / drives.sync_period)
    if what is What.TRANSMIT_OUTAGE:
        if syncs < SEND_ATTEMPTS:
            return Case(name, f"sends again, and goes on if that helps; else {_STOPS}", faults,
                        BusUnavailable, "", outage=length, may_go_on=True)  # fmt: skip
        return Case(name, _STOPS, faults, BusUnavailable, "cannot be sent", outage=length)
    if syncs < BLIND:
        return Case(name, "flags the samples and goes on", faults, None, "", flags=True,
                    outage=length)  # fmt: skip
    return Case(
        name, f"flags the samples; after {BLIND} in a row {_STOPS}", faults, NodeSilent,
        "no TPDO for 10 SYNCs in a row", signs.blindness, flags=True, outage=length,
    )  # fmt: skip


def _in_powering_up(what: What, length: float) -> Case:
    faults = (everywhere(what, When(time=0), Span(time=length)),)
    name = f"{_name(what, length)} in powering up"
    if what is What.TRANSMIT_OUTAGE:
        return Case(name, "gives up; energises no axis, or switches it off again", faults,
                    BusUnavailable, "cannot be sent", condition=powering_up, outage=length,
                    energised=None)  # fmt: skip
    return Case(name, "waits until the drives are seen again, and goes on", faults, None, "",
                condition=powering_up, outage=length)  # fmt: skip


def _disobedient(what: What) -> tuple[Fault]:
    return (fault(what, FULL_SPEED, axis=FAST_AXIS),)


STOP_CASES = (
    *_outages(What.TRANSMIT_OUTAGE),
    *_outages(What.RECEIVE_OUTAGE),
    Case(
        "quick stop ignored, Ctrl-C at 2.4 rad/s", "disables voltage as the axis does not slow"
        " down", _disobedient(What.QUICK_STOP_IGNORED), KeyboardInterrupt, "", signs.event,
        plan=FAST, interrupted=True, way=WAY, off_within=OFF_WITHIN,
    ),
    Case(
        "quick stop shown, axis goes on, Ctrl-C at 2.4 rad/s", "disables voltage as the axis does"
        " not slow down", _disobedient(What.STOP_WITHOUT_EFFECT), KeyboardInterrupt, "",
        signs.event, plan=FAST, interrupted=True, way=WAY, off_within=OFF_WITHIN,
    ),
    Case(
        "disable voltage ignored, Ctrl-C at 2.4 rad/s", "stops all; the heartbeat ends, so that"
        " the drive's watchdog switches it off", _disobedient(What.DISABLE_VOLTAGE_IGNORED),
        KeyboardInterrupt, "joint 1 (node 1)", signs.event, plan=FAST, interrupted=True,
        off_within=WATCHDOG_WITHIN,
    ),
)  # fmt: skip
