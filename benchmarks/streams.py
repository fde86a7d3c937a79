"""Streamed trajectories on a busy computer: shares of ended and of slowed-down runs.

The plant and `hil run` are separate processes. The plant represents drives, which are never late,
so it has the real-time class; eight more processes compute without a pause. Every run streams three
periods of 10 s once, without repetition, from power-on to power-off; first as a normal process,
then in real time::

    python benchmarks/streams.py [RUNS] [INTERFACE] [CHANNEL] [normal] [real-time]
    python tools/can_guest.py .venv/bin/python benchmarks/streams.py 20 socketcan vcan0
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from figures import Figure, keep
from plant_process import load, plant

from hil.runs.run import Run

HIL = (sys.executable, "-m", "hil")
BUSY = 8
"""Number of processes that compute without a pause."""
MANNERS = {"normal": (), "real-time": ("--realtime",)}
"""Options of `hil run`."""
PATIENCE = 600.0
"""Time until a stuck run is abandoned [s]."""


FIGURES, UNITS = ("lasted", "slowed", "flagged"), ("s", "%", "%")


class Streamed(NamedTuple):
    """Result of a run: description, duration [s] and shares of samples; NaN if missing."""

    line: str
    lasted: float = np.nan
    slowed: float = np.nan
    flagged: float = np.nan


def streamed(plan: Path, folder: Path, place: tuple[str, ...], *options: str) -> Streamed:
    """Run the plan once."""
    command = (*HIL, "run", str(plan), "-o", str(folder), *place, *options)
    # separate folder, because unrestored values of an abandoned run would end the next run
    state = {**os.environ, "XDG_STATE_HOME": str(folder.with_suffix(".state"))}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=PATIENCE, env=state
        )
    except subprocess.TimeoutExpired:
        return Streamed(f"under way after {PATIENCE:.0f} s")
    if done.returncode:
        return Streamed(f"ENDED ({done.returncode}): {done.stderr.strip()}")
    recordings = [measured.recording for measured in Run.open(folder)]
    lasted = sum(each.time[-1] - each.time[0] for each in recordings)
    slowed = np.concatenate([each.slowed for each in recordings]).mean()
    flagged = (np.concatenate([each.flags for each in recordings]) != 0).any(axis=-1).mean()
    line = f"{lasted:.0f} s, {slowed:.2%} slowed down, {flagged:.2%} flagged"
    return Streamed(line, lasted, slowed, flagged)


def main(runs: int = 20, interface: str = "local", channel: str = "streams", *asked: str) -> None:
    """Print a line for each run, and keep the results of all."""
    place = ("--interface", interface, "--channel", channel)
    with tempfile.TemporaryDirectory() as scratch:
        plan = Path(scratch) / "trajectory.yaml"
        command = (
            *HIL, "plan", "manutec-r15", "--kind", "trajectory", "--minutes", "0.5",
            "-o", str(plan),
        )  # fmt: skip
        subprocess.run(command, check=True, capture_output=True)
        text = plan.read_text()
        assert "\nattempts: " in text
        plan.write_text(re.sub(r"(?m)^attempts: \d+$", "attempts: 1", text))
        for name in asked or MANNERS:
            found: list[Streamed] = []
            for number in range(runs):
                folder = Path(scratch) / f"{name}-{number}"
                with plant(interface, channel), load(BUSY):
                    found.append(streamed(plan, folder, place, *MANNERS[name]))
                print(f"{name:10s} {number + 1:3d}: {found[-1].line}", flush=True)
            ended = sum(each.line.startswith("ENDED") for each in found)
            print(f"{name}: {ended} of {runs} ended", flush=True)
            kept = {"ended": Figure.count(ended), "runs": Figure.count(runs)}
            done = np.array([each[1:] for each in found if np.isfinite(each.lasted)])
            for what, unit, each in zip(FIGURES, UNITS, done.T * [[1], [100], [100]], strict=True):
                kept[what] = Figure(each.mean(), unit, scatter=each.std())
            keep(
                f"streams-{name}", kept,
                depends=("hil/measuring", "drivers", "hil/cli/doctor.py"),
                command=f"python benchmarks/streams.py {runs} {interface} {channel} {name}",
            )  # fmt: skip


if __name__ == "__main__":
    runs, *place = sys.argv[1:] or ["20"]
    main(int(runs), *place)
