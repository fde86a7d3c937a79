"""SYNCs per second in lock-step, with the plant in a separate process and in the same process.

Buses: a local channel; EtherCAT on a pair of virtual Ethernet interfaces, if run as root; and
vcan0, if present::

    python benchmarks/two_processes.py
    python tools/can_guest.py .venv/bin/python benchmarks/two_processes.py
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from figures import Figure, keep
from plant_process import served

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from foreign_ethercat import THEIRS, carried_out

from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from hil.model.robot import ROBOTS

DRIVES = load_drives(ROBOTS / "manutec-r15.drives.yaml")
DURATION = 3.0
CHUNK = 100


def cycles_per_second(interface: str, channel: str) -> Figure:
    """Return the best rate of several chunks of SYNCs while all axes hold their position."""
    rates: list[float] = []
    with open_drive_bus(DRIVES, interface, channel, pacing="lock-step") as axes:
        ends = time.perf_counter() + DURATION
        while time.perf_counter() < ends:
            begun = time.perf_counter()
            assert not any(any(axes.sample().flags) for _ in range(CHUNK))
            rates.append(CHUNK / (time.perf_counter() - begun))
    return Figure(max(rates), "SYNC/s", scatter=Figure.median(rates).scatter)


def apart(interface: str, channel: str) -> Figure:
    """Return the rate with the plant in another process."""
    with served(interface, channel):
        return cycles_per_second(interface, channel)


def measure_ethercat() -> Figure:
    """Return the rate over EtherCAT, with this file as a script beside the plant."""
    value, scatter = map(float, carried_out(__file__, "beside-the-plant").split()[-2:])
    return Figure(value, "SYNC/s", scatter=scatter)


def main() -> None:
    """Print and keep the rates."""
    if "beside-the-plant" in sys.argv:
        rate = cycles_per_second("ethercat", THEIRS)
        print(rate.value, rate.scatter)
        return
    together = cycles_per_second("sim_plant", "manutec-r15")
    print(f"{'one process':24s} {together.value:8.0f} SYNC/s")
    kept = {"one-process": together}
    places = [("local", "benchmark"), ("ethercat", THEIRS), ("socketcan", "vcan0")]
    for interface, channel in places:
        if interface == "ethercat" and os.geteuid() != 0:
            print(f"{interface} {channel}: only root may make a network namespace")
            continue
        if interface == "socketcan" and not Path(f"/sys/class/net/{channel}").exists():
            print(f"{interface} {channel}: not here; see tools/can_guest.py")
            continue
        rate = measure_ethercat() if interface == "ethercat" else apart(interface, channel)
        ratio = rate.value / together.value
        print(f"{interface + ' ' + channel:24s} {rate.value:8.0f} SYNC/s, ratio {ratio:.3f}")
        kept |= {f"{interface}-over-one-process": Figure(ratio), interface: rate}
    command = "python benchmarks/two_processes.py"
    keep("two-processes", kept, depends=("drivers", "sim_plant"), command=command)


if __name__ == "__main__":
    main()
