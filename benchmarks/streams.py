"""Streamed trajectories on a busy computer: how many are ended, and how much is slowed down.

The plant and `hil run` are processes of their own. The plant stands for drives, which are never
late, so it has the real-time class; eight others compute without a pause. Every run streams three
periods of 10 s and is a session from power-on to power-off::

    python benchmarks/streams.py [RUNS] [INTERFACE] [CHANNEL]
    python tools/can_guest.py .venv/bin/python benchmarks/streams.py 20 socketcan vcan0
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from plant_process import load, plant

from hil.runs.run import Run

HIL = (sys.executable, "-m", "hil")
BUSY = 8
"""Processes that compute without a pause."""
PATIENCE = 600.0
"""Time after which a run that has neither ended nor come to its end is left [s]."""


def streamed(plan: Path, folder: Path, place: tuple[str, ...], *options: str) -> str:
    """Run the plan once; say what became of it."""
    command = (*HIL, "run", str(plan), "-o", str(folder), *place, *options)
    # of its own, since what one that was left has not put back would end the next
    state = {**os.environ, "XDG_STATE_HOME": str(folder.with_suffix(".state"))}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=PATIENCE, env=state
        )
    except subprocess.TimeoutExpired:
        return f"under way after {PATIENCE:.0f} s"
    if done.returncode:
        return f"ENDED ({done.returncode}): {done.stderr.strip()}"
    recordings = [measured.recording for measured in Run.open(folder)]
    slowed = np.concatenate([each.slowed for each in recordings])
    flagged = np.concatenate([each.flags for each in recordings]) != 0
    return f"{slowed.mean():.2%} slowed down, {flagged.any(axis=-1).mean():.2%} flagged"


def main(runs: int = 20, interface: str = "local", channel: str = "streams") -> None:
    """Print a line for each run."""
    place = ("--interface", interface, "--channel", channel)
    with tempfile.TemporaryDirectory() as scratch:
        plan = Path(scratch) / "trajectory.yaml"
        command = (
            *HIL, "plan", "manutec-r15", "--kind", "trajectory", "--minutes", "0.5",
            "-o", str(plan),
        )  # fmt: skip
        subprocess.run(command, check=True, capture_output=True)
        for name, options in (("normal", ()), ("real time", ("--realtime",))):
            ended = 0
            for number in range(runs):
                folder = Path(scratch) / f"{name}-{number}"
                with plant(interface, channel), load(BUSY):
                    line = streamed(plan, folder, place, *options)
                ended += line.startswith("ENDED")
                print(f"{name:10s} {number + 1:3d}: {line}", flush=True)
            print(f"{name}: {ended} of {runs} ended", flush=True)


if __name__ == "__main__":
    runs, *place = sys.argv[1:] or ["20"]
    main(int(runs), *place)
