"""The drive profile works on any fieldbus; here on one other than CAN."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from fake_fieldbus import PERIOD, FakeFieldbus
from local_bench import drives_file

from drivers.axis import Axis, AxisScale
from drivers.cia402.cyclic_position import CyclicPosition
from drivers.cia402.objects import MODE_DISPLAY
from drivers.cia402.power import Power
from drivers.cia402.profile_position import ProfilePosition
from drivers.cia402.samples import SampleReader
from drivers.cia402.shutdown import Shutdown
from drivers.cia402.states import Command, Mode, State
from drivers.cia402.supervision import Supervision
from drivers.drive_bus import DriveFault, Move
from drivers.safety.trips import Trips

if TYPE_CHECKING:
    from drivers.cycle_data import ProcessData
    from drivers.fieldbus import LifeSign

AXES = drives_file().axes
SCALES = [AxisScale.derive(axis) for axis in AXES]


@pytest.fixture
def bus() -> FakeFieldbus:
    return FakeFieldbus(len(AXES))


def power_of(bus: FakeFieldbus) -> Power:
    data: ProcessData = bus
    return Power(data, bus.drives, Supervision(bus.drives))


def shutdown_of(bus: FakeFieldbus) -> Shutdown:
    life_sign: LifeSign = bus
    off = power_of(bus).switch_off
    return Shutdown(bus, life_sign, Axis.all(AXES, bus.drives), PERIOD, off)


def powered(bus: FakeFieldbus) -> None:
    power = power_of(bus)
    for drive in bus.drives:
        power.make_safe(drive, reset_fault=False)
    for goal in (State.SWITCHED_ON, State.OPERATION_ENABLED):
        power.walk(goal, bus.sync)


def stopped(bus: FakeFieldbus) -> Shutdown:
    shutdown = shutdown_of(bus)
    shutdown.begin([1.0] * len(AXES), [10.0] * len(AXES))
    shutdown.switch_off()
    shutdown.conclude()
    return shutdown


def test_no_axis_is_enabled_before_all_are_switched_on(bus: FakeFieldbus) -> None:
    powered(bus)
    assert {drive.state for drive in bus.drives} == {State.OPERATION_ENABLED}
    enabled = [drive.history.index(State.SWITCHED_ON) for drive in bus.drives]
    assert len(set(enabled)) == 1


def test_a_drive_in_a_fault_is_named_and_left_off(bus: FakeFieldbus) -> None:
    bus.drives[1].state = State.FAULT
    with pytest.raises(DriveFault, match="axis 2: FAULT"):
        power_of(bus).make_safe(bus.drives[1], reset_fault=False)


def test_axes_reach_their_targets_by_the_handshake_of_profile_position(bus: FakeFieldbus) -> None:
    powered(bus)
    motion = ProfilePosition(bus, Axis.all(AXES, bus.drives), PERIOD)
    motion.start({axis: Move(0.2, 1.0, 10.0) for axis in range(len(AXES))})
    reader = SampleReader(Axis.all(AXES, bus.drives))
    while motion.active:
        assert motion.advance(bus.sync(), bus) is None
        assert bus.time < 60
    sample = reader.sample(bus.time, bus, reached=True)
    assert sample.q == pytest.approx([0.2] * len(AXES), abs=1e-3)


def test_axes_follow_a_path_in_cyclic_position_and_their_corridor_with_them(
    bus: FakeFieldbus,
) -> None:
    powered(bus)
    trips = Trips(Axis.all(AXES, bus.drives), PERIOD)
    trips.arm(bus.time, bus.positions)
    motion = CyclicPosition(bus, Axis.all(AXES, bus.drives), trips, PERIOD, bus.sync)
    path = np.outer(np.linspace(0.0, 0.05, 50), np.ones(len(AXES)))
    motion.begin(
        path + SampleReader(Axis.all(AXES, bus.drives)).sample(bus.time, bus, reached=True).q
    )
    assert motion.cyclic
    before = bus.positions
    while motion.moving:
        time = bus.sync()
        assert trips.look(time, bus) is None
        assert motion.advance() is None
    ways = [now - then for now, then in zip(bus.positions, before, strict=True)]
    per_count = [scale.position for scale in SCALES]
    assert np.multiply(ways, per_count) == pytest.approx([0.05] * len(AXES), abs=1e-3)
    motion.leave()
    assert {drive.get(MODE_DISPLAY) for drive in bus.drives} == {Mode.PROFILE_POSITION}


def test_what_is_fed_forward_goes_with_each_set_point_and_is_taken_back_by_a_stop(
    bus: FakeFieldbus,
) -> None:
    powered(bus)
    trips = Trips(Axis.all(AXES, bus.drives), PERIOD)
    trips.arm(bus.time, bus.positions)
    motion = CyclicPosition(bus, Axis.all(AXES, bus.drives), trips, PERIOD, bus.sync)
    here = SampleReader(Axis.all(AXES, bus.drives)).sample(bus.time, bus, reached=True).q
    offsets = np.zeros((20, len(AXES), 3))
    offsets[1:-1, 1] = 30, -7, 0
    motion.begin(np.tile(here, (20, 1)), offsets)
    for _ in range(3):
        bus.sync()
        motion.advance()
    assert bus.fed == [(0, 0, 0), (1, 0, 0), (2, 0, 0)] + 3 * [(0, 0, 0), (1, 30, -7), (2, 0, 0)]
    motion.abandon()
    stopped(bus)
    assert not np.any(np.array(bus.fed[12:])[:, 1:])
    assert {axis for axis, _, _ in bus.fed[12:]} == {0, 1, 2}


def test_axes_in_motion_are_stopped_and_switched_off(bus: FakeFieldbus) -> None:
    powered(bus)
    motion = ProfilePosition(bus, Axis.all(AXES, bus.drives), PERIOD)
    motion.start({0: Move(1.0, 1.0, 10.0)})
    for _ in range(10):
        motion.advance(bus.sync(), bus)
    shutdown = stopped(bus)
    assert all(shutdown.off)
    assert bus.alive
    assert shutdown.problems == []
    assert bus.drives[0].history.index(State.QUICK_STOP_ACTIVE) > 0


def test_a_drive_that_obeys_no_command_loses_our_sign_of_life(bus: FakeFieldbus) -> None:
    powered(bus)
    bus.drives[2].deaf = True
    shutdown = stopped(bus)
    assert not bus.alive
    assert "axis 3: 0.15 s after quick stop: state OPERATION ENABLED" in shutdown.problems[0]
    assert bus.commanded[2, Command.QUICK_STOP.value[0]] > 1


def test_a_bus_that_takes_nothing_ends_our_sign_of_life(bus: FakeFieldbus) -> None:
    powered(bus)
    bus.unplug()
    shutdown = stopped(bus)
    assert not bus.alive
    assert not any(shutdown.off)
    (problem,) = shutdown.problems
    assert problem.startswith("axis 1, axis 2, axis 3: does not switch off")
