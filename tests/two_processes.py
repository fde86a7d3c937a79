"""The plant in a process of its own, on whatever buses this machine has between processes."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import can
import pytest

from drivers.drives_file import DrivesFile, load_drives
from hil.model.robot import ROBOTS

if TYPE_CHECKING:
    from collections.abc import Iterator

NO_VCAN = "no vcan0 here; where qemu is: tools/can_guest.py .venv/bin/pytest tests/test_on_vcan.py"
DRIVES = ROBOTS / "manutec-r15.drives.yaml"

needs_vcan = pytest.mark.skipif(not Path("/sys/class/net/vcan0").exists(), reason=NO_VCAN)
BUSES = [
    pytest.param(("local", f"test-{os.getpid()}"), id="local"),
    pytest.param(("socketcan", "vcan0"), id="vcan", marks=needs_vcan),
]
Place = tuple[str, str]


@contextmanager
def plant_process(place: Place, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Serve the plant from another process, which is there when this yields."""
    interface, channel = place
    command = [sys.executable, "-m", "sim_plant", "--interface", interface, "--channel", channel]
    with subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True) as process:  # noqa: S603 - our own program
        try:
            assert process.stdout is not None
            for _ in range(2):
                assert process.stdout.readline()
            yield process
        finally:
            process.kill()


def open_bus(place: Place) -> can.BusABC:
    """Join a bus, as a master or to listen."""
    interface, channel = place
    return can.Bus(channel, interface, ignore_config=True)


def slow_drives(period: float) -> DrivesFile:
    """The plant's drives with a SYNC period that a slow machine keeps [s]."""
    return load_drives(DRIVES).model_copy(update={"sync_period": period, "heartbeat_timeout": 2.0})
