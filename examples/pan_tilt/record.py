"""Make the recordings of this folder again, from the virtual pan-tilt head.

Run it from anywhere, without arguments::

    python examples/pan_tilt/record.py

The plans are trajectories that `hil plan --kind trajectory` designed for
tests/robots/pan-tilt.yaml with seeds 1 and 2 (`--minutes 1 --seed 1`, `--minutes 0.5 --seed 2`);
`plant.yaml` is what `hil twin` makes of that robot file. Each plan is measured on the plant like on
any robot, and written as somebody else's logger would: degrees and amperes, in text.
"""

from __future__ import annotations

import argparse
import gzip
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import hil

HERE = Path(__file__).parent
ROBOT = HERE.parents[1] / "tests" / "robots" / "pan-tilt.yaml"
GAIN = 2.5
"""Torque at the joint for one ampere, gear ratio times torque constant [N m/A]."""
HEADER = "time_s,pan_deg,tilt_deg,pan_A,tilt_A"
FORMAT = ("%.4f", "%.4f", "%.4f", "%.3f", "%.3f")


def measured(plan: Path) -> np.ndarray:
    """Time [s], positions [deg] and currents [A] of a plan's trajectory, shape (n, 5)."""
    with tempfile.TemporaryDirectory() as place:
        twin, run = Path(place) / "twin", Path(place) / "run"
        _call("sim_plant", "twin", ROBOT, "-o", twin)
        plant = ("--channel", HERE / "plant.yaml", "--drives", twin / "drives.yaml")
        _call("hil", "run", plan, "-o", run, *plant)
        (trajectory,) = hil.Run.open(run)
    recording = trajectory.recording
    time = recording.time - recording.time[0]
    return np.column_stack([time, np.degrees(recording.q), recording.tau / GAIN])


def _call(*arguments: object) -> None:
    command = [sys.executable, "-m", *map(str, arguments)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - our own programs


def write(columns: np.ndarray, path: Path) -> None:
    """Write a recording; the same columns make the same file."""
    with (
        path.open("wb") as file,
        gzip.GzipFile("", "wb", fileobj=file, mtime=0) as packed,
    ):
        np.savetxt(packed, columns, FORMAT, ",", header=HEADER, comments="")


def main() -> None:
    """Measure both plans."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=HERE, help="folder to write into")
    output: Path = parser.parse_args().output
    for name in ("excitation", "other"):
        write(measured(HERE / f"{name}.plan.yaml"), output / f"{name}.csv.gz")


if __name__ == "__main__":
    main()
