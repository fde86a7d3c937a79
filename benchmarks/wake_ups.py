"""SYNC on the wall clock with and without real time: flagged samples and jitter at 250 Hz.

Plant and driver are two processes on a local channel. The plant stands for drives, which are never
late, so it has the real-time class in every case, where this machine grants it; only the driver's
side changes. With a load, as many processes as there are cores compute without a pause::

    python benchmarks/wake_ups.py [SAMPLES]
"""

from __future__ import annotations

import gc
import os
import sys
from contextlib import nullcontext
from typing import TYPE_CHECKING

import numpy as np
from plant_process import load, plant

from drivers.drive_bus import SampleFlag
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from hil.cli.realtime import real_time
from hil.model.robot import ROBOTS

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

INTERFACE, CHANNEL = "local", "wake-ups"
WARM_UP = 250
"""Samples that are not counted: the plant compiles or loads what its first SYNC needs."""
PERIOD = 0.004
DRIVES = load_drives(ROBOTS / "manutec-r15.drives.yaml").model_copy(
    update={"sync_period": PERIOD, "heartbeat_timeout": 2.0, "sdo_timeout": 5.0}
)
GAPS = SampleFlag.MISSING | SampleFlag.DOUBLED | SampleFlag.LATE


def measured(samples: int, *, realtime: bool) -> str:
    """Sample axes that hold their position; return what became of SYNC."""
    with (
        open_drive_bus(DRIVES, INTERFACE, CHANNEL) as axes,
        real_time() if realtime else nullcontext(()),
    ):
        gc.collect()
        gc.freeze()
        taken = [axes.sample() for _ in range(samples)]
        gc.unfreeze()
    steps = np.diff([sample.time for sample in taken])
    passed = np.maximum(1, np.rint(steps / PERIOD))
    off = steps - passed * PERIOD
    flagged = sum(any(flag & GAPS for flag in sample.flags) for sample in taken)
    return (
        f"{flagged / samples:7.2%} flagged {(passed - 1).sum() / samples:7.2%} left out"
        f" {1e3 * np.sqrt(np.mean(off**2)):8.3f} ms rms {1e3 * np.abs(off).max():7.2f} ms at most"
    )


def all_cores() -> AbstractContextManager[None]:
    """Keep all cores busy."""
    return load(os.cpu_count() or 1)


def main(samples: int = 5000) -> None:
    """Print a line for each case."""
    with real_time() as measures:
        print(*measures, sep="\n")
    with plant(INTERFACE, CHANNEL, lambda: measured(WARM_UP, realtime=False)):
        for name, burden in (("idle", nullcontext), ("all cores busy", all_cores)):
            for realtime in (False, True):
                with burden():
                    line = measured(samples, realtime=realtime)
                print(f"{name:15s} {'real time' if realtime else 'normal':10s} {line}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
