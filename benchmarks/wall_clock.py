"""Residual torque after a campaign on the wall clock with a busy core, against lock-step.

`hil run` measures a plan once in lock-step, and then on the wall clock while another process
computes without a pause; each run is identified separately. The plant is a separate process, with
the real-time class if `hil run` has it; a plant of a higher class would interrupt the sending of
SYNC. The residual torque is the root mean square of the smoothed residual in motion
(`hil.results.residual`), without flagged samples::

    python benchmarks/wall_clock.py [--realtime] [--interface ethercat] [--runs 3]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep
from plant_process import load, make_real_time, served

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from foreign_ethercat import THEIRS, carried_out

import hil

if TYPE_CHECKING:
    from numpy.typing import NDArray

COUNTS = ("--gravity=9", "--inertia=19", "--coupling=2")
"""Numbers of measurements, sufficient for identification in six minutes."""
BUSY = 1
"""Number of busy cores."""
MOST, FLAGGED = 1.5, 0.1
"""Bounds of the ratio to lock-step, and of the share of flagged samples."""
REAL_TIME = "--realtime"
PATIENCE = 3600.0
"""Time until a stuck run is abandoned [s]."""


def run_beside_plant(interface: str, words: tuple[str, ...], pacing: str) -> None:
    """Carry out `hil run` with the plant in another process."""
    words = ("-m", "hil", "run", *words, "--pacing", pacing, "--interface", interface, "--channel")
    clock = ("--clock", "wall" if pacing == "wall-clock" else "sync")
    if interface == "ethercat":
        options = " ".join(clock)
        print(carried_out(__file__, *words, THEIRS, options=options, timeout=PATIENCE)[-300:])
        return
    with served(interface, "campaign", *clock) as process:
        if REAL_TIME in words:
            make_real_time(process.pid)
        subprocess.run((sys.executable, *words, "campaign"), check=True, timeout=PATIENCE)


def torque_left(folder: Path) -> NDArray[np.float64]:
    """Return the residual torque of the model of a run, shape (n_axes,) [N m]."""
    found = hil.identify(hil.Run.open(folder)).band_residual
    assert found is not None
    return np.array(found.smoothed, dtype=float)


def flagged(folder: Path) -> float:
    """Return the share of samples with a flag."""
    flags = np.concatenate([each.recording.flags for each in hil.Run.open(folder)])
    return float(np.any(flags, axis=1).mean())


def measure(interface: str, runs: int, *options: str) -> dict[str, Figure]:
    """Return the figures of some runs on the wall clock, with options of `hil run`."""
    with tempfile.TemporaryDirectory() as scratch:
        # separate folder, because unrestored values of an abandoned run would end the next run
        os.environ["XDG_STATE_HOME"] = scratch
        plan, place = Path(scratch) / "plan.yaml", Path(scratch) / "lock-step"
        words = ("-m", "hil", "plan", "manutec-r15", *COUNTS, "-o", str(plan))
        subprocess.run((sys.executable, *words), check=True)
        run_beside_plant(interface, (str(plan), "-o", str(place)), "lock-step")
        step = torque_left(place)
        print("lock-step:", *(f"{each:.2f}" for each in step), "N m", flush=True)
        ratios, shares = np.empty((runs, len(step))), np.empty(runs)
        for number in range(runs):
            place = Path(scratch) / f"wall-clock-{number}"
            with load(BUSY):
                run_beside_plant(interface, (str(plan), "-o", str(place), *options), "wall-clock")
            left = torque_left(place)
            ratios[number], shares[number] = left / step, flagged(place)
            print("wall clock:", *(f"{each:.2f}" for each in left), "N m, ratios", end=" ")
            print(*(f"{each:.2f}" for each in ratios[number]), f"{shares[number]:.2%}", end=" ")
            print("flagged; load", *(f"{each:.1f}" for each in os.getloadavg()), flush=True)
    return {
        "worst-ratio": Figure(float(ratios.max()), "times", scatter=ratios.max(axis=1).std()),
        "median-ratio": Figure.median(ratios.ravel(), "times"),
        "flagged": Figure(100 * float(shares.max()), "%", scatter=100 * shares.std()),
        "runs": Figure.count(runs),
    }


def main() -> None:
    """Measure, print and keep the figures."""
    if sys.argv[1:2] == ["-m"]:  # within the namespace of the plant
        if REAL_TIME in sys.argv:
            make_real_time(int(os.environ["PLANT_PID"]))
        sys.exit(subprocess.run((sys.executable, *sys.argv[1:]), check=False).returncode)
    parser = argparse.ArgumentParser(description="Torque left on the wall clock.")
    parser.add_argument("--interface", default="local", choices=("local", "ethercat"))
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument(REAL_TIME, action="store_true")
    asked = parser.parse_args()
    manner = (REAL_TIME,) if asked.realtime else ()
    kept = measure(asked.interface, asked.runs, *manner)
    words = (f"--interface {asked.interface}", f"--runs {asked.runs}", *manner)
    keep(
        "-".join(("wall-clock", asked.interface, *("real-time" for _ in manner))), kept,
        depends=("drivers", "sim_plant", "hil/measuring", "hil/results/band_residual.py"),
        command=f"python benchmarks/wall_clock.py {' '.join(words)}",
    )  # fmt: skip
    sys.exit(kept["worst-ratio"].value > MOST or kept["flagged"].value > 100 * FLAGGED)


if __name__ == "__main__":
    main()
