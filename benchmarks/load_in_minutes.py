"""Errors of a load identified in three minutes by `hil payload measure`: 10.86 kg at 140 mm.

Each seed is a separate measurement, combined with one of a few runs without load::

    python benchmarks/load_in_minutes.py [--seeds 20] [--bare 5] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from accuracy import ROBOT, SIDE_BY_SIDE, hil, rms
from claims import DISTANCE, MASS, make_plant
from figures import Figure, keep

from checked_files.yaml_file import load_yaml
from hil.results.load_file import NAME, LoadFile
from hil.runs.run import Run

FIRST_BARE, FIRST_SEED = 301, 401
TRUTH = {
    "mass": MASS,
    "centre z": DISTANCE,
    "Ixx about the centre": 0.0259,
    "Izz about the centre": 0.047,
}


def bare_run(folder: Path, seed: int) -> Path:
    """Measure the default plan without the load, unless the run exists."""
    run = folder / f"bare-{seed}"
    if not run.exists():
        plant = make_plant("default", seed, run.with_suffix(".yaml"))
        hil("run", folder / "plan.yaml", "-o", run, "--channel", plant, "--bus-option",
            f"seed={seed}")  # fmt: skip
    return run


def measured(folder: Path, bare: Path, seed: int) -> Path:
    """Measure the load after the run `bare` without load, unless the run exists."""
    run = folder / f"load-{seed}"
    if not (run / NAME).exists():
        plant = make_plant("payload", seed, run.with_suffix(".yaml"))
        hil("payload", "measure", "--model", bare, "-o", run, "--channel", plant, "--bus-option",
            f"seed={seed}")  # fmt: skip
    return run


def robot_time(run: Path) -> float:
    """Return the duration of the motion of both stages [s]."""
    stages = [[m.recording.time for m in Run.open(run / name)] for name in ("slow", "fast")]
    return sum(float(times[-1][-1] - times[0][0]) for times in stages)


def print_errors(runs: list[Path]) -> dict[str, Figure]:
    """Print and return errors and coverage of the 95 % intervals."""
    kept: dict[str, Figure] = {}
    files = [load_yaml(run / NAME, LoadFile) for run in runs]
    found = [{q.name: q for q in file.load} for file in files]
    held = []
    for name, truth in TRUTH.items():
        errors = np.array([each[name].value - truth for each in found])
        halves = np.array([each[name].half_width or 0.0 for each in found])
        held.append(np.abs(errors) <= halves)
        percents, key = 100 * np.abs(errors) / truth, name.replace(" ", "-")
        print(
            f"{name}: error {rms(errors):.3g} ({rms(percents):.3f} %), half-width"
            f" {np.median(halves):.3g}, {held[-1].sum()} of {len(errors)} intervals hold the truth"
        )
        kept[f"{key}-error"] = Figure(rms(percents), "%", scatter=float(percents.std()))
        kept[f"{key}-half-width"] = Figure(100 * float(np.median(halves)) / truth, "%")
    distance = [1e3 * (each["centre z"].value - DISTANCE) for each in found]
    kept["centre-distance"] = Figure(rms(distance), "mm", scatter=float(np.std(np.abs(distance))))
    least = [min((axis.p_value for axis in file.rigidity), default=1.0) for file in files]
    print(f"chance of the worst axis, were the load rigid: {min(least):.2g} at least")
    times = [robot_time(run) for run in runs]
    print(f"{100 * np.mean(held):.1f} % of {np.size(held)} intervals; at most {max(times):.0f} s")
    return kept | {
        "inside": Figure.count(np.sum(held)),
        "intervals": Figure.count(np.size(held)),
        "least-chance": Figure(min(least)),
        "longest": Figure(max(times), "s", 3),
    }


def main() -> None:
    """Measure, compare, print and keep."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--bare", type=int, default=5, help="bare runs that seeds share")
    parser.add_argument("--keep", type=Path, help="folder for runs; reused if there")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "plan.yaml").exists():
            hil("plan", ROBOT, "-o", folder / "plan.yaml")
        bare = list(pool.map(lambda k: bare_run(folder, FIRST_BARE + k), range(given.bare)))
        runs = pool.map(
            lambda k: measured(folder, bare[k % len(bare)], FIRST_SEED + k), range(given.seeds)
        )
        command = f"python benchmarks/load_in_minutes.py --seeds {given.seeds} --bare {given.bare}"
        keep(
            "load-in-minutes", print_errors(list(runs)), command=command,
            depends=("hil/estimation/loads", "hil/planning", "sim_plant/physics"),
            seeds=range(FIRST_SEED, FIRST_SEED + given.seeds),
        )  # fmt: skip


if __name__ == "__main__":
    main()
