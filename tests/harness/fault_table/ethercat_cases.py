"""Faults of the table over EtherCAT: those of the bus, and of drives as on CAN."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from drivers.drive_bus import DriveRefused, NodeSilent, Tripped
from drivers.ethercat import registers as reg
from fault_table import signs
from fault_table.case import Case, everywhere, fault
from fault_table.cases import CASES, ONCE
from fault_table.trial import MANY, drives
from sim_plant.faults.fault_plan import Span, What, When
from sim_plant.faults.faulty_network import DRIVE_FAULTS

if TYPE_CHECKING:
    from collections.abc import Iterator

_STOPS = "stops"
_AWAY = "takes no part in the exchange of process data for 10 cycles in a row"
_OTHERWISE = frozenset({What.NODE_RESET, What.BUS_OFF, What.SUPPLY_LOST})
"""Faults that do not exist or have other signs over EtherCAT."""
MID_CYCLE = When(sync=400)
"""Frame with process data in the second stroke."""
SHORT, LONG = 0.025, 0.2
"""Outages with and without consequence [s]."""


def _put(place: int, size: int, value: int, node: Any) -> None:
    node.controller.put(place, size, value)


def _drive_cases() -> Iterator[Case]:
    """Return rows of drives, sensors and motors, independent of the bus."""
    for case in CASES:
        if case.foreign:
            continue
        if {each.what for each in case.faults} <= DRIVE_FAULTS.keys() - _OTHERWISE:
            yield replace(case, shown=signs.jump_latched) if case.shown is signs.jump else case


def _outages(what: What) -> Iterator[Case]:
    name, at = what.replace("-", " "), When(set_point=8, after=0.3)
    for length in (SHORT, LONG):
        faults = (everywhere(what, at, Span(time=length)),)
        yield Case(
            f"{name} of {1000 * length:.0f} ms at Ctrl-C",
            "repeats the command to stop in every frame", faults,
            KeyboardInterrupt, "", interrupted=True, outage=length,
            kind=f"{name} of {{}} ms at Ctrl-C",
        )  # fmt: skip
    yield Case(
        f"{name} of {1000 * SHORT:.0f} ms in a stroke", "flags the samples and continues",
        (everywhere(what, at, Span(time=SHORT)),), None, "", flags=True, outage=SHORT,
    )  # fmt: skip
    yield Case(
        f"{name} of {1000 * LONG:.0f} ms in a stroke", f"after 10 in a row {_STOPS}",
        (everywhere(what, at, Span(time=LONG)),), NodeSilent, _AWAY, signs.blindness, flags=True,
        outage=LONG,
    )  # fmt: skip


ETHERCAT_CASES = (
    Case(
        "one frame does not come back", "flags the sample and the next",
        (everywhere(What.RECEIVE_OUTAGE, lasts=ONCE),), None, "", flags=True,
    ),
    Case(
        "one frame comes late", "flags the sample and the next; drops the late frame",
        (everywhere(What.FRAME_LATE, lasts=ONCE),), None, "", flags=True,
    ),
    Case(
        "5 % of all frames lost", "flags the samples; repeats mailbox requests",
        (everywhere(What.FRAMES_LOST, size=5),), None, "", flags=True,
    ),
    Case(
        "cable cut in front of all drives", "no command arrives; the drives' watchdogs stop them",
        (everywhere(What.CABLE_CUT),), NodeSilent,
        _AWAY, signs.blindness, flags=True,
    ),
    *(
        Case(
            f"cable cut in front of drive {axis}",
            f"{_STOPS} those before the cut; watchdogs stop the others",
            (fault(What.SEGMENT_CUT, MID_CYCLE, axis=axis),), NodeSilent,
            _AWAY, signs.blindness, flags=True,
        )
        for axis in (2, 6)
    ),
    Case(
        "supply of a drive lost", f"{_STOPS}; the drive's brake closes",
        (fault(What.SUPPLY_LOST),), NodeSilent, _AWAY, signs.blindness, flags=True,
    ),
    Case(
        "a drive begins at INIT", _STOPS, (fault(What.NODE_RESET),), NodeSilent,
        "joint 2 (node 2)",
    ),
    Case(
        "a drive falls to SAFEOP with an error", _STOPS, (fault(What.AL_ERROR, code=0x1A),),
        NodeSilent, "shows SAFEOP with error 001A", signs.trouble,
    ),
    Case(
        "mailbox hangs while drives are checked", "refuses; nothing is energised",
        (fault(What.SDO_SILENT, When(frame=400)),), NodeSilent, "joint 2 (node 2)",
        energised=False,
    ),
    Case(
        "mailbox hangs in a campaign", _STOPS,
        (fault(What.SDO_SILENT, When(set_point=1, after=0.2)),), NodeSilent, "joint 2 (node 2)",
    ),
    Case(
        "SDO aborted in a campaign", _STOPS,
        (fault(What.SDO_ABORTED, When(set_point=1, after=0.2), code=0x08000022),), DriveRefused,
        "abort 08000022",
    ),
    *(
        Case(
            f"another participant {what}", f"restores the register within 0.1 s and {_STOPS}",
            (), Tripped, "master or tool changed it", unnoticed=drives.heartbeat_period,
            changed=partial(_put, place, size, value),
        )
        for what, place, size, value in (
            ("switches a drive's watchdog off", reg.WATCHDOG_TIME, 2, 0),
            ("gives a drive's watchdog 6.5 s", reg.WATCHDOG_TIME, 2, 0xFFFF),
        )
    ),
    Case(
        "another participant raises a drive's torque limit", f"{_STOPS} before a later move",
        (), Tripped, "6072:00", changed=lambda node: node.dictionary.set(
            0x6072, 0, 6000), plan=MANY,
    ),
    *_outages(What.TRANSMIT_OUTAGE),
    *_outages(What.RECEIVE_OUTAGE),
    *_drive_cases(),
)  # fmt: skip
