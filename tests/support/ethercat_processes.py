"""The driver and the plant on a cable of two interfaces; one of the two processes is killed.

`python ethercat_processes.py moving` moves an axis on the wall clock and prints a line in motion;
`killed-driver` starts `moving` as a process, kills the process in the middle of the motion, and
prints the states of the drives; `killed-plant FOLDER` measures a plan, and kills the plant while
the run goes on.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from foreign_ethercat import THEIRS

from drivers.drive_bus import DriveError, Move
from drivers.drives_file import DrivesFile, load_drives
from drivers.ethercat import registers as reg
from drivers.ethercat.bus import EthercatBus
from drivers.ethercat.line import Line
from drivers.ethercat.slaves import Station
from drivers.ethercat.wire import RawWire
from drivers.opening import open_drive_bus
from hil.model.robot import ROBOTS, Robot

ROBOT = "manutec-r15"
WATCHDOG = 1.0
"""Watchdog of the sync managers [s]; long, because a busy machine is late."""


def drives() -> DrivesFile:
    file = load_drives(ROBOTS / f"{ROBOT}.drives.yaml")
    return file.model_copy(update={"heartbeat_timeout": WATCHDOG, "sync_period": 0.01})


def moving() -> None:
    """Move an axis slowly over a long distance."""
    with open_drive_bus(drives(), "ethercat", THEIRS) as bus:
        bus.move({0: Move(1.5, 0.2, 1.0)})
        for _ in range(50):
            bus.sample()
        print("moving", flush=True)  # noqa: T201 - read by who started this
        while not bus.sample().reached:
            pass


def killed_driver() -> None:
    """Print AL states and statuswords before the kill, right after the kill and after the stop."""
    process = subprocess.Popen(  # noqa: S603 - this file
        [sys.executable, __file__, "moving"], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    begun = process.stdout.readline().strip()
    process.kill()
    process.wait()
    time.sleep(WATCHDOG + 1.0)
    wire = RawWire(THEIRS)
    line = Line(wire, 0.5)
    stations = [Station(line, n) for n in range(1, 7)]
    states = [(station.status, station.word(reg.AL_CODE)) for station in stations]
    watchdogs = [station.word(reg.WATCHDOG_TIME) for station in stations]
    servers = EthercatBus(wire).unpowered(drives()).servers
    words = [int.from_bytes(server.access.read(0x6041, 0, 2), "little") for server in servers]
    print(json.dumps({"begun": begun, "al": states, "watchdogs": watchdogs, "words": words}))  # noqa: T201 - read by who asked


def killed_plant(folder: Path) -> None:
    """Measure, kill the plant after two recordings, and print how the run ended."""
    from hil.measuring.campaign import run_campaign
    from hil.measuring.sequencer import Recorded
    from hil.planning.design.by_counts import design
    from hil.runs.journal import BusName
    from hil.runs.run_folder import RunFolder

    robot, done, ended = Robot.load(ROBOT), 0, ""
    plan = design(robot, {"gravity": 4, "inertia": 10, "coupling": 1})
    file = load_drives(ROBOTS / f"{ROBOT}.drives.yaml")
    bus = open_drive_bus(file, "ethercat", THEIRS, pacing="lock-step")
    run = RunFolder.create(folder, plan, robot)
    try:
        for event in run_campaign(run, bus, BusName("ethercat", THEIRS)):
            done += isinstance(event, Recorded)
            if done == 2:
                os.kill(int(os.environ["PLANT_PID"]), signal.SIGKILL)
    except DriveError as error:
        ended = f"{type(error).__name__}: {error}"
    print(json.dumps({"done": done, "ended": ended}))  # noqa: T201 - read by who asked


if __name__ == "__main__":
    {
        "moving": moving,
        "killed-driver": killed_driver,
        "killed-plant": lambda: killed_plant(Path(sys.argv[2])),
    }[sys.argv[1]]()
