"""Faults of the table: events, signs, promises."""

from __future__ import annotations

from drivers.drive_bus import (
    BusUnavailable,
    DriveFault,
    DriveRefused,
    MoveFailed,
    NodeSilent,
    Tripped,
)
from fault_table import signs
from fault_table.case import Case, everywhere, fault
from fault_table.stop_cases import STOP_CASES
from sim_plant.faults.fault_plan import Span, What, When

ONCE = Span(syncs=1)
PER_MILLE = 100
"""3 % of the axis's torque limit."""


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
"""One error code of each class of CiA 402."""

_STOPS = "stops"
_GAP = "flags the sample, without a substitute"

FOREIGN = (
    ("has all nodes go pre-operational (NMT)", 0, "8000", "all nodes to go pre-operational"),
    ("stops all nodes (NMT)", 0, "0200", "another master commands all nodes to stop"),
    ("restarts communication of a drive (NMT)", 0, "8202", "to restart its communication"),
    ("sends SYNC", 0x080, "", "another producer sends SYNC (080h)"),
    ("commands a drive by RPDO", 0x202, "409c00001f00", "commands joint 2 (node 2) by RPDO 202h"),
    ("halts a drive by RPDO", 0x202, "000000000f01", "commands joint 2 (node 2) by RPDO 202h"),
    ("takes our heartbeat out of a drive's watch", 0x602, "2316100100000000", "1016:01 of joint 2"),
    ("changes a drive's mode", 0x602, "2f60600003000000", "6060:00 of joint 2 (node 2) = 3h"),
    ("raises a drive's torque limit", 0x602, "2b726000b80b0000", "6072:00 of joint 2"),
    ("switches a drive's TPDO off", 0x602, "2300180182010080", "1800:01 of joint 2"),
)
"""Commands of other participants to drives: identifier, data, message to the operator."""

CASES = (
    Case("one TPDO lost", _GAP, (fault(What.TPDO_LOST, lasts=ONCE),), None, "", flags=True),
    Case(
        "no TPDO any more", f"{_GAP}; after 10 in a row {_STOPS}", (fault(What.TPDO_LOST),),
        NodeSilent, "no TPDO for 10 SYNCs in a row", signs.blindness, flags=True,
    ),
    Case(
        "one TPDO doubled", "flags the sample; the first one counts",
        (fault(What.TPDO_DOUBLED, lasts=ONCE),), None, "", flags=True,
    ),
    Case(
        "every TPDO doubled", f"{_STOPS}: two nodes may share a number",
        (fault(What.TPDO_DOUBLED),), Tripped, "two telegrams for each of 10 SYNCs",
        flags=True,
    ),
    Case(
        "one TPDO late", "flags the sample; drops and flags the late telegram",
        (fault(What.TPDO_LATE, lasts=ONCE),), None, "", flags=True,
    ),
    Case(
        "every TPDO late", f"flags the samples; after 10 in a row {_STOPS}",
        (fault(What.TPDO_LATE),), NodeSilent, "no TPDO for 10 SYNCs in a row", signs.blindness,
        flags=True,
    ),
    Case(
        "SDO silent while drives are checked", "refuses; nothing is energised",
        (fault(What.SDO_SILENT, When(frame=40)),), NodeSilent, "no answer when trying to",
        energised=False,
    ),
    Case(
        "SDO silent in a campaign", _STOPS,
        (fault(What.SDO_SILENT, When(set_point=1, after=0.2)),), NodeSilent,
        "no answer when trying to read", signs.request,
    ),
    Case(
        "SDO aborted in a campaign", _STOPS,
        (fault(What.SDO_ABORTED, When(set_point=1, after=0.2), code=0x08000022),), DriveRefused,
        "abort 08000022", signs.request,
    ),
    Case(
        "EMCY of every class, drive continues", "notes each once and continues",
        tuple(
            fault(What.WARNING, When(set_point=3, after=0.05 * n), code=code)
            for n, code in enumerate(CLASSES)
        ),
        None, "warning 4310 (drive or motor temperature too high)",
    ),
    *(
        Case(
            f"fault {code:04X} ({name})", _STOPS, (fault(What.FAULT, code=code),), DriveFault,
            f"{code:04X} (", signs.trouble,
            kind=f"fault of any class ({', '.join(f'{c:04X} {n}' for c, n in CLASSES.items())})",
        )
        for code, name in CLASSES.items()
    ),
    Case(
        "node reset", _STOPS, (fault(What.NODE_RESET),), NodeSilent, "has restarted (boot-up)",
        signs.trouble,
    ),
    Case(
        "drive's heartbeat lost", f"{_STOPS} after its timeout", (fault(What.HEARTBEAT_LOST),),
        NodeSilent, "no heartbeat for 0.5 s", signs.silence,
    ),
    Case(
        "our heartbeat lost", "the drives stop on their own; the driver then switches all off",
        (everywhere(What.MASTER_HEARTBEAT_LOST),), DriveFault, "8130 (heartbeat of the master",
        signs.trouble,
    ),
    Case(
        "bus-off of a drive", f"{_STOPS} after 10 SYNCs; the drive stops without the heartbeat",
        (fault(What.BUS_OFF),), NodeSilent, "no TPDO for 10 SYNCs",
        signs.blindness, flags=True,
    ),
    Case(
        "bus-off of our adapter", "no command possible; the drives stop without the heartbeat",
        (everywhere(What.ADAPTER_BUS_OFF),), BusUnavailable, "bus-off",
    ),
    Case(
        "cable cut", "no command arrives; the drives stop without the heartbeat",
        (everywhere(What.CABLE_CUT),), NodeSilent, "no TPDO for 10 SYNCs",
        signs.blindness, flags=True,
    ),
    Case(
        "voltage of the DC link lost", _STOPS, (fault(What.VOLTAGE_LOST),), DriveFault,
        "3220 (DC link under-voltage)", signs.trouble,
    ),
    Case(
        "safe torque off of a drive", _STOPS, (fault(What.STO_ACTIVE),), DriveFault,
        "joint 2 (node 2): left OPERATION ENABLED", signs.trouble,
    ),
    Case(
        "supply of a drive lost", f"{_STOPS} after 10 SYNCs; the drive's brake closes",
        (fault(What.SUPPLY_LOST),), NodeSilent, "no TPDO for 10 SYNCs", signs.blindness,
        flags=True,
    ),
    Case(
        "encoder jumps by 0.1 rad", _STOPS, (fault(What.ENCODER_JUMP, size=13690),), Tripped,
        "encoder", signs.jump,
    ),
    Case(
        "encoder jumps by 2 mrad", f"{_STOPS} after the measurement; drops the recording",
        (fault(What.ENCODER_JUMP, size=274),), Tripped, "its position jumps by",
    ),
    Case(
        "current offset before power-on",
        "notes it with the session; a constant offset is estimated",
        (fault(What.CURRENT_OFFSET, When(frame=1),
        size=PER_MILLE),), None, "before power-on its current reads", noted=True,
    ),
    Case(
        "current offset in a stroke", "repeats the recording; notes the offset after power-off",
        (fault(What.CURRENT_OFFSET, size=PER_MILLE),), None, "after power-off its current reads",
        finding="half-sums", noted=True,
    ),
    Case(
        "current clipped", "repeats the recording, then keeps it with its finding",
        (fault(What.CURRENT_CLIPPED, size=PER_MILLE),), None,
        "the sensor is stuck, clipped", finding="current",
    ),
    Case(
        "current stuck for 0.1 s", "repeats the recording",
        (fault(What.CURRENT_STUCK, lasts=Span(time=0.1)),), None,
        "the sensor is stuck, clipped", finding="current",
    ),
    Case(
        "position renewed every 20 ms", "refuses to measure after the first motion",
        (fault(What.POSITION_SLOW, When(time=0), size=20),), DriveRefused,
        "position updated only every 5 SYNCs",
    ),
    Case(
        "current renewed every 20 ms", "flags repeated readings, which no estimate uses",
        (fault(What.CURRENT_SLOW, When(time=0), size=20),), None,
        "updated only every 5 SYNCs", finding="renewal",
    ),
    Case(
        "position stands still for good", "stops when the stroke exceeds its time",
        (fault(What.POSITION_SLOW, size=1e9),), MoveFailed,
        "the encoder has shown no motion",
    ),
    Case(
        "brake closed", _STOPS, (fault(What.BRAKE_CLOSED),), DriveFault,
        "8611 (following error too large)", signs.trouble,
    ),
    Case(
        "motor without strength (following error)",
        f"{_STOPS}; the axis falls during the fault reaction",
        (fault(What.AXIS_WEAK, size=10),),
        DriveFault, "8611 (following error too large)", signs.trouble,
    ),
    Case(
        "push from outside", "continues; the recording shows the push",
        (fault(What.PUSH, size=50.0, lasts=Span(time=0.05)),), None, "",
    ),
    *(
        Case(
            f"another participant {what}", _STOPS, (), Tripped,
            reads, signs.event, foreign=((identifier, bytes.fromhex(data)),),
            kind="another participant commands (NMT, SYNC, RPDO) or configures (SDO) a drive",
        )
        for what, identifier, data, reads in FOREIGN
    ),
    Case(
        "another participant starts all nodes (NMT)", "notes it and continues", (), None,
        "another master commands all nodes to start", foreign=((0, bytes([1, 0])),),
    ),
    Case(
        "another participant reads a drive's objects", "notes it and continues", (), None,
        "another master or tool reads objects of joint 2",
        foreign=((0x602, bytes.fromhex("4064600000000000")),),
    ),
    Case(
        "another device boots with a drive's number", _STOPS, (), NodeSilent,
        "has restarted (boot-up)", signs.event, foreign=((0x702, b"\0"),),
    ),
    *STOP_CASES,
)  # fmt: skip
