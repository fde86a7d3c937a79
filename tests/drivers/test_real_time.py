"""Plant and driver in real time, in separate processes, on a local channel and on vcan.

A single plant on the wall clock serves all tests of a bus. An
emulated guest takes half a minute to start a process: the driver that is killed here is forked.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import struct
import subprocess
from typing import TYPE_CHECKING

import numpy as np
import pytest
from canopen_drive_bus import CanopenDriveBus
from two_processes import BUSES, open_bus, plant_process, slow_drives, wake

from drivers.canopen.network import PumpedNetwork
from drivers.canopen.sdo import server_of
from drivers.drive_bus import DriveFault, Move, SampleFlag
from drivers.fieldbus import Entry
from drivers.session.connection import Place as DrivePlace
from hil.measuring.campaign import run_campaign
from hil.measuring.sequencer import Finished
from hil.model.robot import Robot
from hil.planning.measurement import Gravity
from hil.planning.plan import Plan, PlannedRobot
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import can
    from two_processes import Place

PERIOD = 0.04
HEARTBEAT_LOST = 0x8130
OPERATION_ENABLED = 0x04
STATUSWORD = Entry(0x6041, 0, "u16", "statusword")
VELOCITY = Entry(0x606C, 0, "i32", "velocity actual value")

pytestmark = [pytest.mark.long, pytest.mark.flaky(reruns=2)]


@pytest.fixture(scope="module", params=BUSES)
def place(request: pytest.FixtureRequest) -> Iterator[Place]:
    with plant_process(request.param, "--clock", "wall"):
        wake(request.param)
        yield request.param


@pytest.fixture(scope="module", autouse=True)
def watched(place: Place, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path | None]:
    """Return the output of candump, if available."""
    interface, channel = place
    candump = shutil.which("candump")
    if interface != "socketcan" or candump is None:
        yield None
        return
    log = tmp_path_factory.mktemp("watched") / "candump.log"
    with (
        log.open("w") as file,
        subprocess.Popen([candump, "-L", channel], stdout=file) as watching,  # noqa: S603 - a tool
    ):
        yield log
        watching.kill()


@pytest.fixture
def bus(place: Place) -> Iterator[can.BusABC]:
    with open_bus(place) as bus:
        yield bus


def plan() -> Plan:
    robot = Robot.load("manutec-r15")
    measurement = Gravity(
        id="g1",
        axis=2,
        q=(0.0, -0.3, 0.2, 0.0, 0.5, 0.0),
        stroke=0.4,
        velocity=0.2,
        acceleration=8.0,
        cycles=2,
    )
    return Plan(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        sample_period=PERIOD,
        attempts=1,
        measurements=(measurement,),
    )


def test_a_short_campaign_loses_nothing_that_is_not_flagged(
    bus: can.BusABC, tmp_path: Path
) -> None:
    folder = RunFolder.create(tmp_path / "run", plan(), Robot.load("manutec-r15"))
    *_, last = run_campaign(folder, CanopenDriveBus(bus, slow_drives(PERIOD)))
    assert isinstance(last, Finished)
    sync = folder.journal.sessions[-1].sync
    (kept,) = folder
    whole = ~(kept.recording.flags & SampleFlag.MISSING).astype(bool)
    assert np.array_equal(np.isfinite(kept.recording.q), whole)
    assert whole.mean() > 0.5
    passed = np.ptp(kept.recording.time) / PERIOD
    assert sync.samples + sync.left_out - 1 == pytest.approx(passed, rel=0.02)
    print(sync)  # noqa: T201 - the figures of this machine


def test_a_fault_stops_all_axes_and_switches_them_off(place: Place, bus: can.BusABC) -> None:
    with open_bus(place) as other:
        network = PumpedNetwork(other, synchronous=False)
        servers = [
            server_of(network, DrivePlace(node, f"axis {node}"), 5.0) for node in range(1, 7)
        ]

        drives = slow_drives(PERIOD)
        first, *others = drives.axes
        narrow = first.model_copy(update={"following_error_window": 1e-4})
        drives = drives.model_copy(update={"axes": (narrow, *others)})

        def follow_too_closely() -> None:
            with CanopenDriveBus(bus, drives, reset_faults=True) as axes:
                axes.move({axis: Move(0.5, 0.2, 2.0) for axis in range(6)})
                while True:
                    axes.sample()

        with pytest.raises(DriveFault, match=r"joint 1 .*following error"):
            follow_too_closely()
        assert not any(server.get(STATUSWORD) & OPERATION_ENABLED for server in servers)


def move_until_killed(place: Place) -> None:
    with open_bus(place) as bus, CanopenDriveBus(bus, slow_drives(PERIOD), reset_faults=True) as a:
        a.move({0: Move(-1.5, 0.2, 2.0)})
        while True:
            a.sample()


def test_if_our_process_is_killed_the_drives_stop_by_themselves(
    place: Place, bus: can.BusABC
) -> None:
    network = PumpedNetwork(bus, synchronous=False)
    positions: dict[int, int] = {}
    emergencies: list[int] = []

    def note_position(_id: int, data: bytearray, _time: float) -> None:
        word, position = struct.unpack_from("<Hi", data)
        if word & OPERATION_ENABLED:
            positions[position] = word

    network.subscribe(0x181, note_position)
    network.subscribe(0x81, lambda _id, data, _time: emergencies.append(data[0] + 256 * data[1]))
    driver = multiprocessing.get_context("fork").Process(target=move_until_killed, args=(place,))
    driver.start()
    assert network.pump(100.0, lambda: len(positions) > 10)
    assert driver.pid is not None
    os.kill(driver.pid, signal.SIGKILL)
    driver.join()
    assert network.pump(20.0, lambda: HEARTBEAT_LOST in emergencies)
    server = server_of(network, DrivePlace(1, "axis 1"), 5.0)
    assert network.pump(20.0, lambda: server.get(VELOCITY) == 0)
    assert not server.get(STATUSWORD) & OPERATION_ENABLED


def test_tshark_decodes_all_that_candump_saw_without_a_malformed_frame(
    watched: Path | None, tmp_path: Path
) -> None:
    tshark = shutil.which("tshark")
    if watched is None or tshark is None:
        pytest.skip("needs vcan, candump and tshark")
    seen = watched.read_text().rpartition("\n")[0]
    log = tmp_path / "seen.log"
    log.write_text(seen + "\n")
    shown = subprocess.run(  # noqa: S603 - a tool
        [tshark, "-r", str(log), "-d", "can.subdissector,canopen", "-T", "fields"]
        + [part for field in ("_ws.col.Protocol", "_ws.malformed") for part in ("-e", field)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    assert len(shown) == len(seen.splitlines()) > 1000
    assert {line.strip() for line in shown} == {"CANopen"}
