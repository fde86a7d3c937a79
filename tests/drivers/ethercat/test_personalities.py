"""Drive personalities over EtherCAT: set up, moved and restored, or refused with a reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

import drive_bus_conformance as conformance
import pytest
from personalities import FIT, drives_for, plant_file
from plant_wire import PlantWire

from drivers.drive_bus import DriveRefused, Move
from drivers.ethercat.bus import EthercatBus
from drivers.session.servo_axes import ServoAxes
from sim_plant.ethercat.segment import Segment
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from pathlib import Path

SERVED = (*FIT, "no-watchdog", "wrong-pdos")
"""Personalities that work over EtherCAT, with its own watchdog and its own mappings."""
QUICK = ("bare", "cyclic-only", "fixed-pair", "fixed-pdos", "two-entries", "wrong-pdos")
KEPT = (0x1600, 0x1601, 0x1A00, 0x1A01, 0x1A02, 0x1C12, 0x1C13, 0x6081, 0x607D)


def segment_of(folder: Path, name: str) -> Segment:
    segment = Segment(load_machine(plant_file(folder, name), 5))
    segment.power_on()
    return segment


def held(segment: Segment) -> list[dict[tuple[int, int], int]]:
    return [
        {
            (index, n): node.dictionary.get(index, n)
            for index in KEPT
            for n in range(9)
            if node.dictionary.declares(index, n)
        }
        for node in segment.nodes
    ]


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in SERVED],
)
def test_drives_move_and_are_left_as_they_were(tmp_path: Path, name: str) -> None:
    segment = segment_of(tmp_path, name)
    found = held(segment)
    with ServoAxes(EthercatBus(PlantWire(segment), "lock-step"), drives_for(name)) as bus:
        here = bus.sample().q[0]
        bus.move({0: Move(here + 0.02, 0.2, 0.5)})
        end = conformance.travel(bus)[-1]
    assert end.q[0] == pytest.approx(here + 0.02, abs=3e-3)
    assert held(segment) == found
    assert not [note for note in bus.notes if "announced" in note or "does not hold" in note]


def test_a_drive_without_a_current_is_refused(tmp_path: Path) -> None:
    bus = EthercatBus(PlantWire(segment_of(tmp_path, "no-current")), "lock-step")
    with pytest.raises(DriveRefused, match="6078"):
        ServoAxes(bus, drives_for("no-current")).__enter__()
