"""The plant's slaves on a wire within this process, and sessions with these slaves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from plant_wire import PlantWire

from drivers.drives_file import DrivesFile, load_drives
from drivers.ethercat.bus import EthercatBus
from drivers.session.servo_axes import ServoAxes
from hil.model.robot import ROBOTS
from sim_plant.ethercat.segment import Segment
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from collections.abc import Callable

    Opening = Callable[..., ServoAxes]


@pytest.fixture
def wire() -> PlantWire:
    segment = Segment(load_machine("manutec-r15", 5))
    segment.power_on()
    return PlantWire(segment)


@pytest.fixture
def drives() -> DrivesFile:
    """Drives with short time-outs: here an answer comes at once or never."""
    file = load_drives(ROBOTS / "manutec-r15.drives.yaml")
    return file.model_copy(update={"sdo_timeout": 0.05})


@pytest.fixture
def open_bus(wire: PlantWire, drives: DrivesFile) -> Opening:
    def opened(**options: Any) -> ServoAxes:
        return ServoAxes(EthercatBus(wire, "lock-step"), drives, **options)

    return opened
