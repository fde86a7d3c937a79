"""Loads and gains from imported recordings of virtual twins, against the truth.

    python benchmarks/loads.py [ROBOT ...] [--seeds N]
    python benchmarks/loads.py --write DIR

ROBOT is a robot file's name in tests/robots (scara and ur10e by default). For each seed two runs of
three motions of 20 s are made, without and with a load, by the plant's physics with wandering
friction. The coverage of 95 % intervals is stated for three estimates: the load, with correct
gains; load and gains, with gains wrong by 5 % (standard deviation) and a known mass; parameters and
one unknown gain, from the run without load.

With --write the first pair of the SCARA becomes the run folders DIR/bare and DIR/loaded, torques
read 8 % low on axis 1 and 5 % high on axis 2.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from figures import Figure, keep
from scipy import special

from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.identify import estimate
from hil.estimation.loads.evidence import free_motion_evidence
from hil.estimation.loads.joint import fit_load

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from free_run import write_free_run
from twin_recordings import Load, TwinRecorder, brick, scale_gains

LOADS = {
    "scara": brick(2.805, (0.03, -0.02, 0.05), 0.05),
    "ur10e": brick(6.0, (0.03, -0.02, 0.08), 0.06),
}
SPREAD = 0.05
"""Standard deviation of the gains' logarithms."""
FIRST_SEED = 200


def main() -> None:
    """Print and keep coverage, or write the runs of the documentation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robots", nargs="*", default=["scara", "ur10e"])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    if given.write is not None:
        write(given.write)
        return
    for name in given.robots:
        twin, load = TwinRecorder(name), LOADS.get(name, LOADS["scara"])
        seeds = range(FIRST_SEED, FIRST_SEED + given.seeds)
        results = [cover_seed(twin, load, seed) for seed in seeds]
        kept: dict[str, Figure] = {}
        for what, held in zip(
            ("load", "load by its mass", "gains by it", "parameters", "unknown gain"),
            zip(*results, strict=True),
            strict=True,
        ):
            inside = np.concatenate(held)
            print(f"{name}, {what}: {inside.sum()} of {len(inside)} intervals hold the truth")
            key = what.replace(" ", "-")
            kept[f"{key}-inside"] = Figure.count(inside.sum())
            kept[f"{key}-intervals"] = Figure.count(len(inside))
        command = f"python benchmarks/loads.py {name} --seeds {given.seeds}"
        keep(f"loads-{name}", kept, depends=("hil/estimation",), command=command, seeds=seeds)


def cover_seed(twin: TwinRecorder, load: Load, seed: int) -> list[np.ndarray]:
    """Return coverage of the intervals for one seed."""
    runs = [twin.recorded(2 * seed), twin.recorded(2 * seed + 1, load)]
    truth, mass = load.phi(), load.parameters["m"]
    free = fitted(twin, runs)
    gains = np.exp(SPREAD * np.random.default_rng(seed).standard_normal(twin.n))
    unknown = scale_gains(runs[0], {1: 0.1})
    for _, recording in (*runs[0], *runs[1]):
        recording.tau[:] /= gains
    by_mass = fitted(twin, runs, mass, gains=True)
    alone = estimate(twin.robot, unknown, DEFAULT)
    (gain,) = alone.details.gains
    return [
        *(held(fit.phi - truth, np.sqrt(np.diag(fit.covariance)), fit.degrees)
          for fit in (free, by_mass)),
        held(np.log(by_mass.gains / gains), by_mass.gain_errors, np.full(twin.n, 1e9)),
        np.abs(alone.values - twin.truth) <= alone.half_width(),
        np.array([abs(gain.value - 0.1) <= 1.96 * gain.standard_error]),
    ]  # fmt: skip


def held(error: np.ndarray, standard_error: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Return a mask of errors inside the intervals, for values with a standard error."""
    known = np.isfinite(standard_error) & (standard_error > 0)
    half = special.stdtrit(degrees[known], 0.975) * standard_error[known]
    return np.abs(error[known]) <= half


def fitted(twin: TwinRecorder, runs: list, mass: float | None = None, *, gains: bool = False):
    """Return the load between two runs."""
    gathered = [gather(twin.robot, run, VARIANTS[DEFAULT]) for run in runs]
    bare, loaded = free_motion_evidence(twin.robot, gathered)
    return fit_load(twin.robot, [bare], lambda _: [loaded], mass, gains=gains)


def write(folder: Path) -> None:
    """Write the runs of docs/how-to/payload.md."""
    twin = TwinRecorder("scara")
    for name, seed, load in (("bare", 1, None), ("loaded", 2, LOADS["scara"])):
        data = twin.recorded(seed, load)
        for _, recording in data:
            recording.tau[:, :2] /= (1.08, 0.95)
        write_free_run(folder / name, twin.robot, data)


if __name__ == "__main__":
    main()
