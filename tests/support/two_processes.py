"""Plant in a separate process, on any bus between processes of this machine."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import can
import pytest

from drivers.drives_file import DrivesFile, load_drives
from hil.model.robot import ROBOTS

if TYPE_CHECKING:
    from collections.abc import Iterator

NO_VCAN = (
    "no vcan0 here; where qemu is:"
    " tools/can_guest.py .venv/bin/pytest tests/drivers/test_real_time.py"
)
DRIVES = ROBOTS / "manutec-r15.drives.yaml"

needs_vcan = pytest.mark.skipif(not Path("/sys/class/net/vcan0").exists(), reason=NO_VCAN)
BUSES = [
    pytest.param(("local", f"test-{os.getpid()}"), id="local"),
    pytest.param(("socketcan", "vcan0"), id="vcan", marks=needs_vcan),
]
Place = tuple[str, str]


@contextmanager
def plant_process(place: Place, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Serve the plant from another process, which is ready when this function yields."""
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
    """Join a bus, as a master or a listener."""
    interface, channel = place
    return can.Bus(channel, interface, ignore_config=True)


def wake(place: Place) -> None:
    """Let the plant compile or load its code for SYNC, so that it keeps real time."""
    identity = bytes.fromhex("4018100100000000")
    with open_bus(place) as bus:
        for identifier, data in ((0x80, b""), (0x601, identity)):
            bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
        ends = time.monotonic() + 120.0
        while (frame := bus.recv(1.0)) is None or frame.arbitration_id != 0x581:
            assert time.monotonic() < ends


def slow_drives(period: float) -> DrivesFile:
    """Return the plant's drives with a SYNC period suited to a slow machine [s]."""
    return load_drives(DRIVES).model_copy(
        update={"sync_period": period, "heartbeat_timeout": 2.0, "sdo_timeout": 5.0}
    )
