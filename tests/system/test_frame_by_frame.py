"""A campaign over a bus that delivers single frames, as hardware does, and by the block."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import can
import numpy as np
import pytest
from probing_bench import DRIVES, bench

from drivers.can_bus.capabilities import capabilities_of
from drivers.canopen.drive_bus import CanopenDriveBus
from drivers.drives_file import load_drives
from hil.measuring.events import Recorded
from hil.measuring.sequencer import measure
from hil.runs.recording import Recording

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.planning.plan import Plan

pytestmark = pytest.mark.slow


def measured(bus: can.BusABC, plan: Plan, robot: Robot) -> dict[str, Recording]:
    with CanopenDriveBus(bus, load_drives(DRIVES)) as drive_bus:
        events = [e for e in measure(plan, robot, drive_bus) if isinstance(e, Recorded)]
    assert not any(event.findings for event in events)
    return {event.measurement.id: event.recording for event in events}


def test_a_campaign_frame_by_frame_gives_the_recordings_of_one_by_the_block(
    small_plan: Plan, manutec: Robot
) -> None:
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True) as bus:
        assert capabilities_of(bus).blocks is bus
        by_block = measured(bus, small_plan, manutec)
    with bench() as bus:
        assert capabilities_of(bus).blocks is None
        by_frame = measured(bus, small_plan, manutec)
    assert list(by_frame) == list(by_block) == [m.id for m in small_plan.measurements]
    for name, recording in by_block.items():
        for field in fields(Recording):
            here, there = getattr(recording, field.name), getattr(by_frame[name], field.name)
            np.testing.assert_array_equal(here, there, f"{name}: {field.name}")
