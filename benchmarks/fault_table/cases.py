"""The faults of the table: what happens, what shows it, what is promised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.drive_bus import (
    BusUnavailable,
    DriveError,
    DriveFault,
    DriveRefused,
    NodeSilent,
    Tripped,
)
from fault_table import signs
from fault_table.trial import AXIS
from sim_plant.faults.fault_plan import Fault, Span, What, When

if TYPE_CHECKING:
    from fault_table.signs import Sign

MID_STROKE = When(set_point=3, after=0.3)
"""In the second stroke; the first set-point is the travel to the start."""
ONCE = Span(syncs=1)
PER_MILLE = 100
"""3 % of the axis's torque limit."""


@dataclass(frozen=True)
class Case:
    """One row of the table.

    Attributes
    ----------
    name, does : str
        What happens, and what the driver does about it.
    faults : tuple of Fault
    error : type or None
        What ends the campaign; None when it goes on to its end.
    reads : str
        What the operator reads, among other things.
    shown : callable, optional
        Finds the frame that shows the fault, where axes have to be stopped.
    findings : str, optional
        The check that finds a recording unfit.
    flags : bool
        Samples are flagged one by one.
    noted : bool
        What is wrong with the samples of a whole session is noted with it.
    energised : bool
        Whether the axes were energised at all.
    """

    name: str
    does: str
    faults: tuple[Fault, ...]
    error: type[DriveError] | None
    reads: str
    shown: Sign | None = None
    finding: str = ""
    flags: bool = False
    noted: bool = False
    energised: bool = True


def _fault(what: What, at: When = MID_STROKE, lasts: Span | None = None, **more: float) -> Fault:
    whole = {"what": what, "axis": AXIS, "at": at, "lasts": lasts, **more}
    return Fault.model_validate(whole)


def _everywhere(what: What) -> Fault:
    return Fault(what=what, at=MID_STROKE)


CLASSES = {
    0x1000: "generic",
    0x2310: "current",
    0x3210: "voltage",
    0x4310: "temperature",
    0x5441: "hardware",
    0x6320: "software",
    0x7305: "sensor",
    0x8611: "monitoring",
    0x9000: "external",
    0xFF01: "maker's own",
}
"""One code of each class of CiA 402."""

_STOPS = "stops all axes and switches them off"
_GAP = "flags the sample and never guesses it"

CASES = (
    Case("one TPDO lost", _GAP, (_fault(What.TPDO_LOST, lasts=ONCE),), None, "", flags=True),
    Case(
        "no TPDO any more", f"{_GAP}; after 10 in a row {_STOPS}", (_fault(What.TPDO_LOST),),
        NodeSilent, "no TPDO for 10 SYNCs in a row", signs.blindness, flags=True,
    ),
    Case(
        "one TPDO doubled", "flags the sample; the first one counts",
        (_fault(What.TPDO_DOUBLED, lasts=ONCE),), None, "", flags=True,
    ),
    Case(
        "every TPDO doubled", "flags the samples; the recording is repeated, then kept with its"
        " finding", (_fault(What.TPDO_DOUBLED),), None, "doubled or late telegrams",
        finding="telegrams", flags=True,
    ),
    Case(
        "one TPDO late", "flags its sample as missing; drops it when it comes, with a flag",
        (_fault(What.TPDO_LATE, lasts=ONCE),), None, "", flags=True,
    ),
    Case(
        "every TPDO late", f"as one lost, then one late; after 10 in a row {_STOPS}",
        (_fault(What.TPDO_LATE),), NodeSilent, "no TPDO for 10 SYNCs in a row", signs.blindness,
        flags=True,
    ),
    Case(
        "SDO silent while drives are checked", "refuses; nothing is energised",
        (_fault(What.SDO_SILENT, When(frame=40)),), NodeSilent, "no answer when trying to",
        energised=False,
    ),
    Case(
        "SDO silent in a campaign", f"{_STOPS}, known from their TPDOs",
        (_fault(What.SDO_SILENT, When(set_point=1, after=0.2)),), NodeSilent,
        "no answer when trying to write", signs.request,
    ),
    Case(
        "SDO aborted in a campaign", f"{_STOPS}, known from their TPDOs",
        (_fault(What.SDO_ABORTED, When(set_point=1, after=0.2), code=0x08000022),), DriveRefused,
        "abort 08000022", signs.request,
    ),
    Case(
        "EMCY of every class, drive works on", "notes each once and goes on",
        tuple(
            _fault(What.WARNING, When(set_point=3, after=0.05 * n), code=code)
            for n, code in enumerate(CLASSES)
        ),
        None, "warning 4310 (drive or motor temperature too high)",
    ),
    *(
        Case(
            f"fault {code:04X} ({name})", _STOPS, (_fault(What.FAULT, code=code),), DriveFault,
            f"{code:04X} (", signs.trouble,
        )
        for code, name in CLASSES.items()
    ),
    Case(
        "node reset", _STOPS, (_fault(What.NODE_RESET),), NodeSilent, "has restarted (boot-up)",
        signs.trouble,
    ),
    Case(
        "drive's heartbeat lost", f"after its time-out {_STOPS}", (_fault(What.HEARTBEAT_LOST),),
        NodeSilent, "no heartbeat for 0.5 s", signs.silence,
    ),
    Case(
        "our heartbeat lost", "the drives stop by themselves; so seen, all are switched off",
        (_everywhere(What.MASTER_HEARTBEAT_LOST),), DriveFault, "8130 (heartbeat of the master",
        signs.trouble,
    ),
    Case(
        "bus-off of a drive", f"after 10 SYNCs without it {_STOPS}; the cut off one stops by itself"
        " as it misses our heartbeat", (_fault(What.BUS_OFF),), NodeSilent, "no TPDO for 10 SYNCs",
        signs.blindness, flags=True,
    ),
    Case(
        "bus-off of our adapter", "can command nothing; the drives stop by themselves as they miss"
        " our heartbeat", (_everywhere(What.ADAPTER_BUS_OFF),), BusUnavailable, "bus-off",
    ),
    Case(
        "cable cut", "commands all to stop into the void; the drives stop by themselves as they"
        " miss our heartbeat", (_everywhere(What.CABLE_CUT),), NodeSilent, "no TPDO for 10 SYNCs",
        signs.blindness, flags=True,
    ),
    Case(
        "voltage of the DC link lost", _STOPS, (_fault(What.VOLTAGE_LOST),), DriveFault,
        "3220 (DC link under-voltage)", signs.trouble,
    ),
    Case(
        "supply of a drive lost", f"after 10 SYNCs without it {_STOPS}; its brake is closed",
        (_fault(What.SUPPLY_LOST),), NodeSilent, "no TPDO for 10 SYNCs", signs.blindness,
        flags=True,
    ),
    Case(
        "encoder jumps by 0.1 rad", _STOPS, (_fault(What.ENCODER_JUMP, size=13690),), Tripped,
        "encoder", signs.jump,
    ),
    Case(
        "encoder jumps by 2 mrad", "drops the recording when the measurement is over, then"
        f" {_STOPS}", (_fault(What.ENCODER_JUMP, size=274),), Tripped, "its position jumps by",
    ),
    Case(
        "current offset before power-on", "notes it with the session; a constant offset of an axis"
        " is part of what is estimated", (_fault(What.CURRENT_OFFSET, When(frame=1),
        size=PER_MILLE),), None, "before power-on its current reads", noted=True,
    ),
    Case(
        "current offset in a stroke", "finds that the half-sums of strokes differ and repeats the"
        " recording; notes the offset with the session after power-off",
        (_fault(What.CURRENT_OFFSET, size=PER_MILLE),), None, "after power-off its current reads",
        finding="half-sums", noted=True,
    ),
    Case(
        "current clipped", "finds readings that repeat themselves; the recording is repeated, then"
        " kept with its finding", (_fault(What.CURRENT_CLIPPED, size=PER_MILLE),), None,
        "its sensor is stuck, clipped", finding="current",
    ),
    Case(
        "current stuck for 0.1 s", "finds readings that repeat themselves; the recording is"
        " repeated", (_fault(What.CURRENT_STUCK, lasts=Span(time=0.1)),), None,
        "its sensor is stuck, clipped", finding="current",
    ),
    Case(
        "brake closed", _STOPS, (_fault(What.BRAKE_CLOSED),), DriveFault,
        "8611 (following error too large)", signs.trouble,
    ),
    Case(
        "motor without strength (following error)", f"{_STOPS}; the axis falls until its drive ends"
        " the fault reaction", (_fault(What.AXIS_WEAK, size=10),),
        DriveFault, "8611 (following error too large)", signs.trouble,
    ),
)  # fmt: skip
