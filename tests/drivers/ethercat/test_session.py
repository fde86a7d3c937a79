"""Sessions with the plant's EtherCAT slaves, in lock-step within this process."""

from __future__ import annotations

import math
import random
import struct
from typing import TYPE_CHECKING

import drive_bus_conformance as conformance
import pytest
from probing_bench import Scripted

from drivers.cia402.states import State
from drivers.drive_bus import DriveRefused, Move, NodeSilent, SampleFlag
from drivers.drives_file import Homing
from drivers.ethercat import registers as reg
from drivers.ethercat.bus import EthercatBus
from drivers.ethercat.line import START, Command
from drivers.ethercat.registers import AlState
from drivers.found_settings.keeping import SettingsKeeper
from drivers.found_settings.settings_file import load_found_settings
from drivers.operator_tools.home import home, jog
from drivers.operator_tools.put_back import put_back
from drivers.session.servo_axes import ServoAxes
from sim_plant.ethercat.al_states import AlState as PlantState

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from plant_wire import PlantWire

    from drivers.drives_file import DrivesFile

    Opening = Callable[..., ServoAxes]

ENABLED, OFF = 0x27, 0x40
AXES = 6


class TestConformance(conformance.DriveBusConformance):
    """Contract of every `DriveBus`, over EtherCAT."""


def shown(wire: PlantWire) -> list[int]:
    """Return states of the drives by their statuswords."""
    return [node.dictionary.get(0x6041) & 0x6F for node in wire.segment.nodes]


def al(wire: PlantWire) -> list[int]:
    return [int(node.states.state) for node in wire.segment.nodes]


def register(wire: PlantWire, place: int) -> list[int]:
    return [node.controller.word(place) for node in wire.segment.nodes]


def objects(wire: PlantWire) -> list[dict[tuple[int, int], object]]:
    """Return all objects of the drives that a session may write."""
    kept = (0x1600, 0x1A00, 0x1C12, 0x1C13, 0x1C32, 0x1C33, 0x6065, 0x6067, 0x6081, 0x607D)
    return [
        {
            (index, n): node.dictionary.get(index, n)
            for index in kept
            for n in range(9)
            if node.dictionary.declares(index, n)
        }
        for node in wire.segment.nodes
    ]


def sample(bus: ServoAxes, count: int) -> None:
    for _ in range(count):
        bus.sample()


def cyclic(frame: bytes) -> bool:
    return frame[START] == Command.LRW


def test_axes_are_under_power_inside_and_off_outside(open_bus: Opening, wire: PlantWire) -> None:
    with open_bus() as bus:
        assert shown(wire) == [ENABLED] * AXES
        assert al(wire) == [AlState.OP] * AXES
        assert bus.notes == ()
    assert [word & 0x4F for word in shown(wire)] == [OFF] * AXES
    assert al(wire) == [AlState.INIT] * AXES


def test_the_watchdog_is_set_while_inside_and_put_back(open_bus: Opening, wire: PlantWire) -> None:
    found = register(wire, reg.WATCHDOG_TIME)
    with open_bus() as bus:
        bus.sample()
        assert register(wire, reg.WATCHDOG_TIME) == [5000] * AXES  # 0.5 s from the drives file
        assert [node.controller.managers[2].feeds_watchdog for node in wire.segment.nodes]
    assert register(wire, reg.WATCHDOG_TIME) == found


def test_what_was_found_is_put_back(open_bus: Opening, wire: PlantWire) -> None:
    found = objects(wire)
    with open_bus(feed_forward=True) as bus:
        assert objects(wire) != found
        here = bus.sample().q[0]
        bus.move({0: Move(here + 0.05, 0.5, 1.0)})
        conformance.travel(bus)
    assert objects(wire) == found


def test_a_watchdog_that_somebody_changes_is_refused_before_power_on(
    open_bus: Opening, wire: PlantWire
) -> None:
    def changed(frame: bytes) -> bytes:
        if cyclic(frame):
            wire.segment.nodes[2].controller.put(reg.WATCHDOG_TIME, 2, 0)
        return frame

    wire.on_the_way = changed
    with pytest.raises(DriveRefused, match=r"joint 3 \(node 3\): the watchdog .* is 0 s"):
        open_bus().__enter__()
    assert [word & 0x4F for word in shown(wire)] == [OFF] * AXES


def test_a_sample_of_a_lost_frame_is_flagged_and_so_is_the_next(
    open_bus: Opening, wire: PlantWire
) -> None:
    with open_bus() as bus:
        bus.sample()
        wire.on_the_way_back = lambda _: None
        lost = bus.sample()
        wire.on_the_way_back = bytes
        after, then = bus.sample(), bus.sample()
    assert lost.flags == (SampleFlag.MISSING,) * AXES
    assert after.flags == (SampleFlag.MISSING,) * AXES, "it may be older than is stated"
    assert then.flags == (0,) * AXES


def test_an_axis_that_takes_no_part_is_flagged_alone(open_bus: Opening, wire: PlantWire) -> None:
    with open_bus() as bus:
        bus.sample()
        node = wire.segment.nodes[4]
        fmmu = node.controller.memory[reg.FMMU + 12]
        node.controller.memory[reg.FMMU + 12] = 0
        node.controller.set_up = None
        sample = bus.sample()
        node.controller.memory[reg.FMMU + 12] = fmmu
        node.controller.set_up = None
        after = bus.sample()
    assert sample.flags == (0, 0, 0, 0, SampleFlag.MISSING, 0)
    assert after.flags == (0, 0, 0, 0, SampleFlag.MISSING, 0)


def test_inputs_stand_under_the_instant_at_which_they_were_latched(
    open_bus: Opening, wire: PlantWire
) -> None:
    with open_bus() as bus:
        latched: list[tuple[float, int]] = []

        def noted(frame: bytes) -> bytes:
            if cyclic(frame):
                latched.append((wire.segment.time, wire.segment.nodes[0].dictionary.get(0x6064)))
            return frame

        wire.on_the_way_back = noted
        here = bus.sample()
        bus.move({0: Move(here.q[0] + 0.1, 1.0, 2.0)})
        samples = [bus.sample() for _ in range(50)]
        offset = samples[-1].time - latched[-2][0]
        assert all(
            s.time - at == pytest.approx(offset)
            for s, (at, _) in zip(samples, latched[:-1], strict=True)
        )


def test_a_drive_that_leaves_op_stops_all_axes(open_bus: Opening, wire: PlantWire) -> None:
    with open_bus() as bus:
        bus.sample()
        wire.segment.nodes[1].states.fall(PlantState.SAFEOP, 0x1A)
        with pytest.raises(NodeSilent, match=r"joint 2 .* SAFEOP with error 001A"):
            sample(bus, 5)
    assert ENABLED not in shown(wire)


def test_axes_move_again_after_a_reset(open_bus: Opening, wire: PlantWire) -> None:
    with open_bus() as bus:
        here = bus.sample().q[0]
        wire.segment.nodes[1].states.fall(PlantState.SAFEOP, 0x1A)
        with pytest.raises(NodeSilent):
            sample(bus, 5)
        bus.reset()
        assert shown(wire) == [ENABLED] * AXES
        bus.move({0: Move(here + 0.02, 0.5, 1.0)})
        assert conformance.travel(bus)[-1].q[0] == pytest.approx(here + 0.02, abs=3e-3)


def test_an_emergency_of_a_drive_that_works_on_is_noted(open_bus: Opening, wire: PlantWire) -> None:
    with open_bus() as bus:
        bus.sample()
        wire.segment.nodes[3].coe.emergency(struct.pack("<HB5x", 0x4210, 8))
        for _ in range(5):
            bus.sample()
        assert any("joint 4" in note and "4210" in note for note in bus.notes)


def test_drives_are_found_by_alias_wherever_they_are(
    wire: PlantWire, drives: DrivesFile, open_bus: Opening
) -> None:
    for node, alias in zip(wire.segment.nodes, (7, 8, 9, 10, 11, 12), strict=True):
        node.controller.put(reg.ALIAS, 2, alias)
    axes = tuple(
        axis.model_copy(update={"alias": 7 + number, "node": 6 - number})
        for number, axis in enumerate(drives.axes)
    )
    drives = drives.model_copy(update={"axes": axes})
    bus = EthercatBus(wire, "lock-step")
    servers = bus.unpowered(drives).servers
    assert [server.access.read(0x1018, 4) for server in servers] == [
        bytes([node.dictionary.get(0x1018, 4) & 0xFF]) + bytes(3) for node in wire.segment.nodes
    ]


def test_two_drives_with_the_same_alias_are_refused(wire: PlantWire, drives: DrivesFile) -> None:
    for node in wire.segment.nodes:
        node.controller.put(reg.ALIAS, 2, 7)
    axes = tuple(axis.model_copy(update={"alias": 7}) for axis in drives.axes)
    bus = EthercatBus(wire, "lock-step")
    servers = bus.unpowered(drives.model_copy(update={"axes": axes})).servers
    with pytest.raises(DriveRefused, match=r"slaves 1, 2, 3, 4, 5, 6 .* same alias 7"):
        servers[0].access.leave_operational()


def test_a_drive_that_is_missing_is_named(open_bus: Opening, wire: PlantWire) -> None:
    wire.segment.cuts.add(5)
    with pytest.raises(NodeSilent, match=r"joint 6 \(node 6\): .*5 slaves are on the line"):
        open_bus().__enter__()


@pytest.mark.parametrize("share", [0.01, 0.05, 0.2])
def test_a_session_with_lost_frames_comes_to_its_end(
    open_bus: Opening, wire: PlantWire, share: float
) -> None:
    """Frames are lost during set-up, motion, power-off and restoring of settings."""
    found, chance = objects(wire), random.Random(1)

    def lossy(frame: bytes) -> bytes | None:
        return None if chance.random() < share / 2 else frame

    wire.on_the_way = wire.on_the_way_back = lossy
    with open_bus() as bus:
        bus.move({axis: Move(0.1, 0.5, 1.0) for axis in range(3)})
        samples = conformance.travel(bus)
    flagged = sum(any(sample.flags) for sample in samples)
    assert flagged / len(samples) < 0.08 + 3 * share
    whole = [sample for sample in samples if not any(sample.flags)]
    assert whole[-1].q[0] == pytest.approx(0.1, abs=3e-3)
    assert objects(wire) == found
    assert [word & 0x4F for word in shown(wire)] == [OFF] * AXES


def test_another_master_on_the_line_stops_all_axes(open_bus: Opening, wire: PlantWire) -> None:
    with open_bus() as bus:
        bus.sample()
        other = bytearray(60)
        wire.on_the_way_back = lambda frame: wire._back.append(bytes(other)) or frame
        with pytest.raises(NodeSilent, match="another master"):
            sample(bus, 8)
    assert [word & 0x4F for word in shown(wire)] == [OFF] * AXES


def test_what_drives_of_an_alias_held_is_put_back_wherever_they_are(
    open_bus: Opening, wire: PlantWire, drives: DrivesFile, tmp_path: Path
) -> None:
    for node, alias in zip(wire.segment.nodes, (7, 8, 9, 10, 11, 12), strict=True):
        node.controller.put(reg.ALIAS, 2, alias)
    axes = tuple(
        axis.model_copy(update={"alias": 7 + number, "node": 6 - number})
        for number, axis in enumerate(drives.axes)
    )
    drives = drives.model_copy(update={"axes": axes})
    found, file = objects(wire), tmp_path / "found-settings.yaml"
    keeper = SettingsKeeper(file, lambda path, content: path.write_bytes(content))
    with ServoAxes(EthercatBus(wire, "lock-step"), drives, keeper=keeper) as bus:
        bus.sample()
        kept = load_found_settings(file)
        ours = [node.dictionary.get(0x6065) for node in wire.segment.nodes]
    for node, window in zip(wire.segment.nodes, ours, strict=True):
        node.dictionary.set(0x6065, 0, window)
    assert objects(wire) != found
    list(put_back(EthercatBus(wire, "lock-step"), kept))
    assert objects(wire) == found


def test_speeds_are_those_of_the_positions(open_bus: Opening) -> None:
    """Times of the following cycle would give higher speeds."""
    with open_bus() as bus:
        data, there = bus._session.connection.process_data, 0
        bus.move({0: Move(bus.sample().q[0] + 0.5, 0.5, 5.0)})
        for _ in range(100):
            before, there = there, data.positions[0]
            bus.sample()
        speed = (there - before) / bus.period
        assert data.speeds()[0] == pytest.approx(speed, rel=0.02)


def test_a_scan_shows_al_states_and_what_drives_offer(wire: PlantWire) -> None:
    scan = EthercatBus(wire, "lock-step").scan()
    nodes = [scan.nodes[node] for node in range(1, AXES + 1)]
    assert [(node.shown_by, node.state) for node in nodes] == [("AL state", "INIT")] * AXES
    assert all(found.review is not None for found in scan.nodes.values())


def test_one_axis_jogs_and_no_other_is_powered(wire: PlantWire, drives: DrivesFile) -> None:
    way = math.radians(3)
    with EthercatBus(wire, "lock-step") as bus:
        stroke = jog(bus, drives, drives.axes[1], way, math.radians(5), Scripted())
        assert al(wire)[:1] + al(wire)[2:] == [AlState.INIT] * (AXES - 1)
    assert stroke.q[-1] - stroke.q[0] == pytest.approx(way, abs=2e-3)
    assert al(wire) == [AlState.INIT] * AXES, "as it was found"
    assert [word & 0x4F for word in shown(wire)] == [OFF] * AXES


def test_an_axis_is_homed_where_it_stands(wire: PlantWire, drives: DrivesFile) -> None:
    how = Homing(method=37, position=0.5, velocity=0.2, creep=0.02, acceleration=1.0)
    place = home(
        EthercatBus(wire, "lock-step"), drives, drives.axes[0], how, Scripted(), patience=10
    )
    assert place == pytest.approx(0.5, abs=2e-3)


def test_monitoring_asks_by_mailboxes_what_drives_show(wire: PlantWire, drives: DrivesFile) -> None:
    with EthercatBus(wire, "lock-step") as bus:
        picture = bus.picture(drives)
        picture.listen(0.05)
    assert al(wire) == [AlState.INIT] * AXES
    assert [axis.state for axis in picture.axes] == [State.SWITCH_ON_DISABLED] * AXES
    assert all(abs(axis.q) < 0.1 for axis in picture.axes if axis.q is not None)
    assert set(shown(wire)) == {OFF}
