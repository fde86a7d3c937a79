"""The driver works with independent drives: canopen's, in threads on a stock virtual bus."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import can
import numpy as np
import pytest
import stated_axis
from canopen_drive_bus import CanopenDriveBus
from foreign_drive import FRICTION, ForeignDrive

from drivers.drive_bus import DriveFault, Move, SampleFlag
from drivers.drives_file import DrivesFile
from hil.runs.recording import Recorder
from sim_plant.canopen.eds import EDS_PATH

if TYPE_CHECKING:
    from collections.abc import Iterator

CHANNEL = "foreign drives"
BAD = SampleFlag.MISSING | SampleFlag.DOUBLED | SampleFlag.LATE
NODES = (11, 42)
RATINGS = {
    (0x1018, 1): 0x0BAD,
    (0x1018, 2): 0x0D,
    (0x6072, 0): 3000,
    (0x6073, 0): 3000,
    (0x6075, 0): 2000,
    (0x6076, 0): 1000,
    (0x607F, 0): 10**6,
    (0x6080, 0): 6000,
    (0x608F, 1): 2048,
    (0x608F, 2): 1,
    (0x6092, 1): 2048,  # one count is one increment
    (0x60C5, 0): 10**8,
    (0x60C6, 0): 10**8,
}


def axis(node: int) -> dict[str, object]:
    return stated_axis.axis(
        name=f"foreign {node}",
        node=node,
        identity={"vendor": 0x0BAD, "product": 0x0D},
        gear_ratio=50,
        sign=-1 if node == NODES[1] else 1,
        increments_per_revolution=2048,
        rated_torque=1.0,
        limits={"q_min": -2, "q_max": 2, "velocity": 2, "acceleration": 20, "torque": 100},
        following_error_window=0.5,
        following_error_time=0.5,
    )


@pytest.fixture
def foreign() -> Iterator[list[ForeignDrive]]:
    """Two drives on the bus."""
    drives = [ForeignDrive(CHANNEL, node, str(EDS_PATH), RATINGS) for node in NODES]
    yield drives
    for drive in drives:
        drive.shutdown()


@pytest.fixture
def bus(foreign: list[ForeignDrive]) -> Iterator[CanopenDriveBus]:
    """The driver on the same bus, in lock-step; the threads may be slow."""
    drives = DrivesFile.model_validate(
        {"bitrate": 1_000_000, "axes": [axis(node) for node in NODES]}
    )
    with can.Bus(interface="virtual", channel=CHANNEL) as can_bus:
        yield CanopenDriveBus(can_bus, drives, pacing="lock-step")


def test_an_axis_of_it_moves_and_is_recorded(
    foreign: list[ForeignDrive], bus: CanopenDriveBus
) -> None:
    recorder = Recorder()
    with bus:
        assert [drive.state for drive in foreign] == ["enabled", "enabled"]
        bus.move({0: Move(0.1, 0.5, 5.0), 1: Move(-0.05, 0.5, 5.0)})
        sample = bus.sample()
        while not sample.reached:
            recorder.add(sample)
            sample = bus.sample()
            assert sample.time < 10
        recorder.add(sample)
    recording = recorder.finish()
    good = ~np.any(recording.flags & BAD, axis=1)
    assert good.mean() > 0.9  # on a very busy machine threads are late
    assert recording.q[good][-1] == pytest.approx([0.1, -0.05], abs=1e-3)
    speed = np.diff(recording.q[:, 0]) / np.diff(recording.time)
    assert np.nanmax(speed) == pytest.approx(0.5, rel=0.05)
    torque = FRICTION / 1000 * 2.0 * 0.5 * 50
    under_way = good & (recording.q[:, 0] > 0.02) & (recording.q[:, 0] < 0.08)
    assert recording.tau[under_way, 0] == pytest.approx(torque)
    assert foreign[0].position == round(0.1 * 50 * 2048 / (2 * math.pi))
    assert [drive.state for drive in foreign] == ["off", "off"]
    assert all(drive.history.count("enabled") == 1 for drive in foreign)


def test_a_drive_that_switches_itself_off_stops_the_other(
    foreign: list[ForeignDrive], bus: CanopenDriveBus
) -> None:
    with pytest.raises(DriveFault, match=r"foreign 42 .*left OPERATION ENABLED"), bus:  # noqa: PT012
        bus.sample()
        foreign[1].state = "off"
        for _ in range(5):
            bus.sample()
    assert [drive.state for drive in foreign] == ["off", "off"]
