"""Drives of the plant with a fault plan, frame by frame."""

from __future__ import annotations

import struct

from checked_files.yaml_file import parse_yaml
from sim_plant.faults.fault_plan import FaultPlan
from sim_plant.faults.faulty_network import FaultyNetwork
from sim_plant.plant import load_plant

SYNC = (0x80, b"")


def plan(*lines: str) -> FaultPlan:
    return parse_yaml("faults:\n" + "\n".join(f"  - {line}" for line in lines), FaultPlan, "f.yaml")


def network(*lines: str) -> FaultyNetwork:
    faults = plan(*lines) if lines else FaultPlan(faults=())
    made = FaultyNetwork(load_plant("manutec-r15"), "sync", faults)
    made.power_on()
    return made


def write(faulty: FaultyNetwork, node: int, *what: int) -> bytes:
    index, sub, size, value = what
    data = struct.pack("<BHBI", 0x23 | (4 - size) << 2, index, sub, value)
    answer = faulty.receive(0x600 + node, data)[-1][2]
    assert answer[0] == 0x60, answer.hex()
    return answer
