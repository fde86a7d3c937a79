"""Drives that acknowledge a set-point late, or only at the target."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import can
import drive_bus_conformance as conformance
import pytest
import yaml
from canopen_drive_bus import CanopenDriveBus
from personalities import drives_for, plant_file

from drivers.drive_bus import DriveFault, Move, MoveFailed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from drivers.drive_bus import DriveBus

ACKNOWLEDGE, NEW = 0x1000, 0x10


@pytest.fixture
def held(tmp_path: Path) -> Iterator[can.BusABC]:
    channel = plant_file(tmp_path, "held-acknowledge")
    with can.Bus(channel, "sim_plant", ignore_config=True) as bus:
        yield bus


class TestConformanceWithHeldAcknowledge(conformance.DriveBusConformance):
    @pytest.fixture
    def open_bus(self, held: can.BusABC) -> Callable[[], DriveBus]:
        return lambda: CanopenDriveBus(held, drives_for("held-acknowledge"))

    def test_a_new_set_point_replaces_one_under_way(self, open_bus: Callable[[], DriveBus]) -> None:
        """Drives that hold the acknowledge reach the present target before they start to the new
        one."""
        with open_bus() as bus:
            start = bus.sample().q[0]
            bus.move({0: Move(start + 0.2, 0.2, 4.0)})
            for _ in range(round(0.2 / bus.period)):
                assert not bus.sample().reached
            bus.move({0: Move(start, 0.2, 4.0)})
            samples = conformance.travel(bus)
            assert max(sample.q[0] for sample in samples) == pytest.approx(start + 0.2, abs=2e-3)
            assert samples[-1].q[0] == pytest.approx(start, abs=2e-3)


def travelled(drive_bus: CanopenDriveBus, most: float = 20.0) -> float:
    """Sample until all axes have arrived; return the duration [s]."""
    begin = drive_bus.sample().time
    while not (sample := drive_bus.sample()).reached:
        assert sample.time < begin + most
    return sample.time - begin


def test_a_motion_longer_than_the_acknowledge_timeout_is_waited_for(held: can.BusABC) -> None:
    with CanopenDriveBus(held, drives_for("held-acknowledge")) as drive_bus:
        drive_bus.move({0: Move(1.0, 0.5, 5.0)})
        assert travelled(drive_bus) == pytest.approx(2.1, abs=0.15)
        assert drive_bus.sample().q[0] == pytest.approx(1.0, abs=1e-3)


def test_the_drives_file_must_say_so(held: can.BusABC) -> None:
    drives = drives_for("held-acknowledge", acknowledge="taken")
    drive_bus = CanopenDriveBus(held, drives)
    remedy = r"joint 1 .*another, .*state acknowledge: reached"
    with pytest.raises(MoveFailed, match=remedy), drive_bus:
        _go(drive_bus)


def test_a_set_point_that_comes_meanwhile_waits_for_the_one_before(held: can.BusABC) -> None:
    with (
        can.Bus(held.channel_info.removeprefix("simulated plant "), "sim_plant") as listener,
        CanopenDriveBus(held, drives_for("held-acknowledge")) as drive_bus,
    ):
        drive_bus.move({0: Move(0.4, 0.5, 5.0)})
        for _ in range(50):
            drive_bus.sample()
        drive_bus.move({0: Move(-0.2, 0.5, 5.0)})
        furthest = 0.0
        while not (sample := drive_bus.sample()).reached:
            furthest = max(furthest, sample.q[0])
        assert furthest == pytest.approx(0.4, abs=2e-3)
        assert sample.q[0] == pytest.approx(-0.2, abs=2e-3)
        offered, acknowledged = 0, False
        for frame in iter(lambda: listener.recv(0), None):
            if frame.arbitration_id == 0x181:
                acknowledged = bool(int.from_bytes(frame.data[:2], "little") & ACKNOWLEDGE)
            if frame.arbitration_id == 0x201 and frame.data[4] & NEW:
                assert not acknowledged
                offered += 1
        assert offered == 2


def test_a_halt_breaks_the_motion_off_and_the_axis_moves_again(held: can.BusABC) -> None:
    with CanopenDriveBus(held, drives_for("held-acknowledge")) as drive_bus:
        drive_bus.move({0: Move(1.0, 0.5, 5.0)})
        drive_bus.move({0: Move(-1.0, 0.5, 5.0)})
        for _ in range(50):
            drive_bus.sample()
        drive_bus.halt()
        travelled(drive_bus)
        stopped = drive_bus.sample().q[0]
        assert 0 < stopped < 0.2
        for _ in range(200):  # the queued set-point is discarded
            assert drive_bus.sample().q[0] == pytest.approx(stopped, abs=2e-3)
        drive_bus.move({0: Move(0.3, 0.5, 5.0)})
        travelled(drive_bus)
        assert drive_bus.sample().q[0] == pytest.approx(0.3, abs=2e-3)


def test_an_axis_that_is_blocked_under_way_fails_in_bounded_time(tmp_path: Path) -> None:
    channel = plant_file(tmp_path, "held-acknowledge")
    fault = tmp_path / "fault.yaml"
    fault.write_text("faults: [{what: voltage-lost, axis: 1, at: {set_point: 1, after: 0.3}}]\n")
    with can.Bus(channel, "sim_plant", ignore_config=True, faults=str(fault)) as bus:
        drive_bus = CanopenDriveBus(bus, drives_for("held-acknowledge"))
        with pytest.raises(DriveFault, match=r"joint 1 .*3220"), drive_bus:
            _go(drive_bus)


def _go(drive_bus: CanopenDriveBus) -> None:
    drive_bus.move({0: Move(1.0, 0.5, 5.0)})
    travelled(drive_bus)


def late(folder: Path, lag: float) -> str:
    """Return the channel of a plant whose drives acknowledge with this delay."""
    (folder / "late.yaml").write_text(yaml.safe_dump({"name": "late", "acknowledge_lag": lag}))
    channel = plant_file(folder, "plain")
    plant = yaml.safe_load((folder / "plain.yaml").read_text())
    for axis in plant["axes"]:
        axis["drive"]["personality"] = "late.yaml"
    (folder / "plain.yaml").write_text(yaml.safe_dump(plant))
    return channel


@pytest.mark.parametrize(
    ("changes", "serves"),
    [
        ({}, False),
        ({"acknowledge_timeout": 1.0}, False),
        ({"acknowledge_timeout": 2.0}, True),
        ({"acknowledge": "reached"}, True),
    ],
)
def test_a_late_acknowledge_is_waited_for_as_long_as_the_drives_file_says(
    changes: dict[str, Any], serves: bool, tmp_path: Path
) -> None:
    with can.Bus(late(tmp_path, 0.8), "sim_plant", ignore_config=True) as bus:
        drive_bus = CanopenDriveBus(bus, drives_for("plain", **changes))
        if serves:
            with drive_bus:
                _go(drive_bus)
        else:
            with pytest.raises(MoveFailed, match=r"joint 1 .*for too long"), drive_bus:
                _go(drive_bus)
