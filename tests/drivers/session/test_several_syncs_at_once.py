"""Several SYNCs per call in lock-step have no effect on recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import pytest
from canopen_drive_bus import CanopenDriveBus

from drivers.drive_bus import DriveError, Move, Sample, SampleFlag, Tripped
from drivers.drives_file import load_drives
from hil.runs.recording import Recorder
from sim_plant.physics.state import ENABLED
from sim_plant.serving.plant_channel import PlantChannel, _channels
from sim_plant.slave_network import SlaveNetwork

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drive_bus import DriveBus
    from sim_plant.slave_network import FramesOfSync

MANUTEC = Path(__file__).parents[3] / "hil" / "robots" / "manutec-r15.drives.yaml"
MOVES = {0: Move(0.3, 0.8, 4.0), 3: Move(-0.5, 2.0, 8.0)}
FOR_EVER = 10_000


def moved(take: Callable[[DriveBus], list[Sample]], **options: Any) -> list[Sample]:
    """Return all samples of a move there and back, and of half a second at rest."""
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True, **options) as bus:
        with CanopenDriveBus(bus, load_drives(MANUTEC)) as axes:
            found = take_until_reached(axes, MOVES, take)
            found += take_until_reached(axes, {0: Move(0.0, 0.8, 4.0)}, take)
            end = found[-1].time + 0.5
            while found[-1].time < end:
                found += take(axes)
        return found


def take_until_reached(
    axes: DriveBus, moves: dict[int, Move], take: Callable[[DriveBus], list[Sample]]
) -> list[Sample]:
    axes.move(moves)
    found = take(axes)
    while not found[-1].reached:
        found += take(axes)
    return found


def one(axes: DriveBus) -> list[Sample]:
    return [axes.sample()]


def several(axes: DriveBus) -> list[Sample]:
    return list(axes.samples(FOR_EVER))


def test_samples_are_those_of_single_syncs() -> None:
    singly, at_once = moved(one), moved(several)
    common = min(len(singly), len(at_once))
    assert common > 400
    assert at_once[:common] == singly[:common]


def test_most_syncs_pass_several_at_once_across_heartbeats() -> None:
    sizes: list[int] = []

    def counted(axes: DriveBus) -> list[Sample]:
        found = several(axes)
        sizes.append(len(found))
        return found

    assert len(moved(counted)) > 10 * len(sizes)


def test_a_drive_that_restarts_within_the_syncs_at_once_stops_the_axes() -> None:
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True) as bus:
        with CanopenDriveBus(bus, load_drives(MANUTEC)) as axes:
            axes.move(MOVES)
            for _ in range(20):
                axes.samples(FOR_EVER)
            network: Any = _channels["manutec-r15"]._network
            network._timers.start("restart", 0.05, network.nodes[2].restart)
            before = network.time
            with pytest.raises(DriveError, match=r"joint 3 .*restarted"):
                [axes.samples(FOR_EVER) for _ in range(20)]
            assert network.time - before < 1.0
        assert not network._machine.state[:, ENABLED].any()


def test_never_more_than_asked_for() -> None:
    with (
        can.Bus("manutec-r15", "sim_plant", ignore_config=True) as bus,
        CanopenDriveBus(bus, load_drives(MANUTEC)) as axes,
    ):
        axes.sample()
        sizes = [len(axes.samples(limit)) for limit in (1, 2, 3, 7) for _ in range(20)]
    assert all(size <= limit for size, limit in zip(sizes, sorted([1, 2, 3, 7] * 20), strict=True))
    assert max(sizes) == 7


def test_a_second_bus_on_the_channel_sees_every_frame() -> None:
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True) as listener:
        listener.set_filters([{"can_id": 0x080, "can_mask": 0x7FF}])
        found = moved(several)
        heard = sum(listener.recv(0) is not None for _ in range(2 * len(found)))
    assert heard >= len(found)


def test_a_torque_beyond_its_limit_stops_the_axes_within_the_syncs_at_once() -> None:
    drives = load_drives(MANUTEC)
    first = drives.axes[0]
    trip = first.trip.model_copy(update={"torque": 1.0, "torque_time": 0.1})
    weak = drives.model_copy(
        update={"axes": (first.model_copy(update={"trip": trip}), *drives.axes[1:])}
    )
    ended: list[float] = []
    for take in (one, several):
        with can.Bus("manutec-r15", "sim_plant", ignore_config=True) as bus:
            with (
                pytest.raises(Tripped, match=r"joint 1.*trip\.torque"),
                CanopenDriveBus(bus, weak) as axes,
            ):
                take_until_reached(axes, MOVES, take)
            network: Any = _channels["manutec-r15"]._network
            assert not network._machine.state[:, ENABLED].any()
            ended.append(network.time)
    assert ended[1] - ended[0] < 30 * 0.004


def test_a_recorder_packs_samples_as_one_by_one() -> None:
    singly, at_once = Recorder(), Recorder()
    taken: list[Sample] = []

    def recorded(axes: DriveBus) -> list[Sample]:
        samples = axes.samples(FOR_EVER)
        at_once.extend(samples)
        taken.extend(samples)
        return list(samples)

    moved(recorded)
    for sample in taken:
        singly.add(sample)
    for name, values in singly.finish().arrays.items():
        assert values.tobytes() == at_once.finish().arrays[name].tobytes(), name
    assert not any(flag & SampleFlag.MISSING for sample in taken for flag in sample.flags)


def test_after_an_interrupt_amid_several_syncs_the_drives_take_the_next_frame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # 1000h: no drive answers SYNC with this object
    upload = bytes([0x40, 0x00, 0x10, 0, 0, 0, 0, 0])
    with (
        can.Bus("manutec-r15", "sim_plant", ignore_config=True) as bus,
        CanopenDriveBus(bus, load_drives(MANUTEC)) as axes,
    ):
        network: Any = _channels["manutec-r15"]._network
        occupied, frames_since = PlantChannel._occupy_for, [0]
        receive_repeatedly = SlaveNetwork.receive_repeatedly

        def received(self: SlaveNetwork, identifier: int, times: int) -> list[Any]:
            found = receive_repeatedly(self, identifier, times)
            frames_since[0] = -len(found)
            return found

        def interrupted(self: PlantChannel, frames: FramesOfSync) -> float:
            frames_since[0] += 1
            if frames_since[0] == -3:
                raise KeyboardInterrupt
            return occupied(self, frames)

        with monkeypatch.context() as patch:
            patch.setattr(SlaveNetwork, "receive_repeatedly", received)
            patch.setattr(PlantChannel, "_occupy_for", interrupted)
            with pytest.raises(KeyboardInterrupt):
                [axes.samples(FOR_EVER) for _ in range(100)]
        assert [number for _, number, _ in network.receive(0x601, upload)] == [0x581]
