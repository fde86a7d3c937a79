"""Campaign of two minutes in real time, with a search for lost or wrong samples without a flag.

Plant and driver are two processes on vcan0, with 25 SYNCs a second by default; candump records the
frames. Every sample without a flag must equal the values sent by the drives after its SYNC::

    python tools/can_guest.py .venv/bin/python benchmarks/real_time.py [SYNCS_PER_SECOND] [SECONDS]
"""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep

from drivers.axis import AxisScale
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from hil.measuring.campaign import run_campaign
from hil.model.robot import ROBOTS, Robot
from hil.planning.measurement import Gravity
from hil.planning.plan import Plan, PlannedRobot
from hil.planning.timetable import timetable
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drivers.drives_file import DrivesFile
    from hil.runs.recording import Recording

ROBOT = "manutec-r15"
CHANNEL = "vcan0"
SAME = 5e-4
"""Bound of the difference between two stamps of one SYNC after conversion to another clock [s]."""


def make_plan(period: float, duration: float) -> Plan:
    """Repeat one gravity measurement up to a total duration [s]."""
    robot = Robot.load(ROBOT)
    place = (0.0, -0.3, 0.2, 0.0, 0.5, 0.0)
    strokes = {"axis": 2, "q": place, "stroke": 0.4, "velocity": 0.2, "acceleration": 8.0}
    one = Gravity(id="g1", cycles=3, **strokes)

    def plan(number: int) -> Plan:
        return Plan(
            robot=PlannedRobot(name=robot.name, digest=robot.digest),
            sample_period=period,
            attempts=1,
            measurements=tuple(one.model_copy(update={"id": f"g{k}"}) for k in range(number)),
        )

    each = timetable(plan(2), robot, plan(2).measurements, place)[1]
    return plan(int(duration / (each.travel + each.duration)) + 1)


def witnessed(log: str, drives: DrivesFile) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the instants of SYNC (n,) [s], and the next positions (n, n_axes) [increments]."""
    axis_of = {0x180 + axis.node: index for index, axis in enumerate(drives.axes)}
    instants: list[float] = []
    positions: list[list[float]] = []
    for line in log.splitlines():
        stamp, _, frame = line.split()[:3]
        identifier, _, data = frame.partition("#")
        number = int(identifier, 16)
        if number == 0x80:
            instants.append(float(stamp[1:-1]))
            positions.append([np.nan] * len(drives.axes))
        elif number in axis_of and positions:
            positions[-1][axis_of[number]] = struct.unpack_from("<i", bytes.fromhex(data), 2)[0]
    return np.array(instants), np.array(positions)


def unlike(
    recording: Recording, drives: DrivesFile, seen: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> int:
    """Count the samples without a flag that differ from the logged values after their SYNC."""
    instants, positions = seen
    shifts = instants[: -recording.n_samples + 1] - recording.time[0]
    nearest = [np.searchsorted(instants, recording.time + shift - SAME) for shift in shifts]
    off = [
        np.abs(instants[np.minimum(k, len(instants) - 1)] - recording.time - shift).max()
        for k, shift in zip(nearest, shifts, strict=True)
    ]
    best = int(np.argmin(off))
    assert off[best] < SAME, f"the witness saw other SYNCs: {off[best]:.2g} s off"
    scales = [AxisScale.derive(axis) for axis in drives.axes]
    q = [(positions[nearest[best], j] - s.zero) * s.position for j, s in enumerate(scales)]
    wrong = ~np.isclose(recording.q, np.transpose(q), rtol=0, atol=1e-9)
    return int(np.any(wrong & (recording.flags == 0), axis=1).sum())


def main(rate: float = 25.0, duration: float = 120.0) -> None:
    """Measure, judge and keep."""
    candump = shutil.which("candump")
    if not Path(f"/sys/class/net/{CHANNEL}").exists() or candump is None:
        sys.exit(f"needs {CHANNEL} and candump (can-utils); see tools/can_guest.py")
    drives = load_drives(ROBOTS / f"{ROBOT}.drives.yaml").model_copy(
        update={"sync_period": 1 / rate, "heartbeat_timeout": 2.0, "sdo_timeout": 5.0}
    )
    place = ["--interface", "socketcan", "--channel", CHANNEL]
    with tempfile.TemporaryDirectory() as scratch:
        folder = RunFolder.create(
            Path(scratch) / "run", make_plan(1 / rate, duration), Robot.load(ROBOT)
        )
        log = Path(scratch) / "candump.log"
        with (
            log.open("w") as file,
            subprocess.Popen([candump, "-L", CHANNEL], stdout=file) as witness,
            subprocess.Popen(
                [sys.executable, "-m", "sim_plant", *place, "--clock", "wall"],
                stdout=subprocess.PIPE,
            ) as plant,
        ):
            try:
                assert plant.stdout is not None
                assert plant.stdout.readline(), "the plant did not start"
                *_, last = run_campaign(folder, open_drive_bus(drives, "socketcan", CHANNEL))
            finally:
                witness.terminate()
                plant.kill()
        seen = witnessed(log.read_text(), drives)
        lost = sum(unlike(measured.recording, drives, seen) for measured in folder)
        sync = folder.journal.sessions[-1].sync
        print(f"{last.time:.0f} s of robot time, {rate:g} SYNC/s: {sync}")
        print(f"samples lost or wrong without a flag: {lost}")
    counts = {"samples": sync.samples, "flagged": sync.flagged, "left-out": sync.left_out}
    kept = {name: Figure.count(number) for name, number in (counts | {"lost": lost}).items()}
    kept["jitter"], kept["worst"] = Figure(1e3 * sync.jitter, "ms"), Figure(1e3 * sync.worst, "ms")
    keep(
        "real-time", kept | {"robot-time": Figure(last.time, "s", 3)},
        depends=("drivers/canopen", "drivers/can_bus", "drivers/sync_clock.py"),
        command=f"python benchmarks/real_time.py {rate:g} {duration:g}",
    )  # fmt: skip
    sys.exit(lost > 0)


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
