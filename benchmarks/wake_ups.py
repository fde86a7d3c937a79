"""SYNC on the wall clock with and without real time: flagged samples and jitter at 250 Hz.

Plant and driver are two processes on a local channel. The plant represents drives, which are never
late, so it always has the real-time class, if granted; only the scheduling of the driver differs.
As a load, one process per core computes without a pause::

    python benchmarks/wake_ups.py [SAMPLES]
"""

from __future__ import annotations

import gc
import os
import sys
from contextlib import nullcontext
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep
from plant_process import load, plant

from drivers.drive_bus import SampleFlag
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from hil.cli.bus_access import real_time_if
from hil.model.robot import ROBOTS

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

INTERFACE, CHANNEL = "local", "wake-ups"
WARM_UP = 250
"""Number of samples excluded at the start: the plant compiles or loads code at its first SYNC."""
PERIOD = 0.004
DRIVES = load_drives(ROBOTS / "manutec-r15.drives.yaml").model_copy(
    update={"sync_period": PERIOD, "heartbeat_timeout": 2.0, "sdo_timeout": 5.0}
)
GAPS = SampleFlag.MISSING | SampleFlag.DOUBLED | SampleFlag.LATE
KEPT = {"flagged": "%", "left-out": "%", "rms": "ms", "worst": "ms"}
"""Units of the values of `measured`."""


def measured(samples: int, *, realtime: bool) -> list[float]:
    """Sample axes at rest; return the statistics of SYNC, as in `KEPT`."""
    with (
        open_drive_bus(DRIVES, INTERFACE, CHANNEL) as axes,
        real_time_if(realtime, lock_step=False),
    ):
        gc.collect()
        gc.freeze()
        taken = [axes.sample() for _ in range(samples)]
        gc.unfreeze()
    steps = np.diff([sample.time for sample in taken])
    passed = np.maximum(1, np.rint(steps / PERIOD))
    off = steps - passed * PERIOD
    flagged = sum(any(flag & GAPS for flag in sample.flags) for sample in taken)
    shares = 100 * flagged / samples, 100 * (passed - 1).sum() / samples
    return [*shares, 1e3 * np.sqrt(np.mean(off**2)), 1e3 * np.abs(off).max()]


def all_cores() -> AbstractContextManager[None]:
    """Keep all cores busy."""
    return load(os.cpu_count() or 1)


def main(samples: int = 5000) -> None:
    """Print and keep a line for each case."""
    with real_time_if(True, lock_step=False) as measures:
        print(*measures, sep="\n")
    kept: dict[str, Figure] = {}
    with plant(INTERFACE, CHANNEL, lambda: measured(WARM_UP, realtime=False)):
        for name, burden in (("idle", nullcontext), ("all cores busy", all_cores)):
            for realtime in (False, True):
                with burden():
                    found = measured(samples, realtime=realtime)
                how, (flagged, left_out, rms, most) = "real time" if realtime else "normal", found
                print(
                    f"{name:15s} {how:10s} {flagged:6.2f}% flagged {left_out:6.2f}% left out"
                    f" {rms:8.3f} ms rms {most:7.2f} ms at most",
                    flush=True,
                )
                case = f"{name} {how}".replace(" ", "-")
                for value, (what, unit) in zip(found, KEPT.items(), strict=True):
                    kept[f"{case}-{what}"] = Figure(value, unit)
            key = name.replace(" ", "-")
            ratio = kept[f"{key}-real-time-rms"].value / kept[f"{key}-normal-rms"].value
            kept[f"{key}-real-time-over-normal"] = Figure(ratio)
    depends = ("drivers/sync_clock.py", "drivers/canopen", "hil/cli/doctor.py")
    command = f"python benchmarks/wake_ups.py {samples}"
    keep("wake-ups", kept, depends=depends, command=command)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
