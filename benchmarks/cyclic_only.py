"""Models from drives in cyclic position mode, against those from drives in profile position mode.

One plan is measured on plants of several seeds (noise and friction), once by drives in profile
position mode, which plan the strokes, and once by drives with cyclic position mode only, for which
the driver plans the strokes. Both runs are identified by the improved method. Two runs with
independent errors differ by sqrt(2) standard errors rms, the means of all seeds by sqrt(2 / seeds).
The table has, in standard errors, the difference of two runs in profile position mode, of two in
cyclic mode and of a pair with both modes; the difference of the means; and the errors by mode::

    python benchmarks/cyclic_only.py [--first 901] [--seeds 8] [--runs FOLDER]
"""

from __future__ import annotations

import argparse
from itertools import combinations, product
from pathlib import Path

import numpy as np
from figures import Figure, keep
from golden import MANUTEC, PLANS, must

from hil.estimation.identify import estimate
from hil.ground_truth.true_parameters import true_parameters
from hil.runs.pooling import Pooled
from hil.runs.run import Run

PLAN = "rough"
KINDS = {"profile": (), "cyclic": ("personality=cyclic-only",)}
"""Operation mode of the drives, profile or cyclic position, with the options of the plant."""


def measured(folder: Path, kind: str, seed: int) -> Run:
    """Return the run of one seed, recorded if missing."""
    run = folder / f"{kind}-{seed}"
    if not (folder / f"{PLAN}.yaml").exists():
        command, *rest = PLANS[PLAN]
        must(folder, command, *rest, "-o", f"{PLAN}.yaml")
    if not run.exists():
        options = (f"seed={seed}", *KINDS[kind])
        must(folder, "run", f"{PLAN}.yaml", "-o", run,
             *(word for each in options for word in ("--bus-option", each)))  # fmt: skip
    return Run.open(run)


def main() -> None:
    """Measure, identify and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--first", type=int, default=901)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--runs", type=Path, default=Path("build/cyclic_only"))
    given = parser.parse_args()
    folder = given.runs.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, list[np.ndarray]] = {kind: [] for kind in KINDS}
    errors = []
    seeds = range(given.first, given.first + given.seeds)
    for seed in seeds:
        for kind in KINDS:
            run = measured(folder, kind, seed)
            made = estimate(run.robot, Pooled([run]), "improved")
            found[kind].append(made.values)
            errors.append(np.sqrt(np.diag(made.scatter_covariance)))
            print(kind, seed, flush=True)
    error = np.sqrt(np.mean(np.square(errors), axis=0))
    # estimates over standard errors, shape (seeds, n_base)
    profile, cyclic = (np.array(rows) / error for rows in found.values())
    truth = true_parameters(run.robot, MANUTEC) / error

    def rms(differences: object) -> float:
        return float(np.sqrt(np.mean(np.square(np.asarray(differences)))))

    kept = {}
    print("differences in standard errors, rms over all base parameters")
    for name, pairs in (
        ("two profile runs", combinations(profile, 2)),
        ("two cyclic runs", combinations(cyclic, 2)),
        ("one of each", product(profile, cyclic)),
        ("one of each, of the same seed", zip(profile, cyclic, strict=True)),
    ):
        apart = [rms(one - other) for one, other in pairs]
        print(f"{name:30s} {rms(apart):.2f} ({min(apart):.2f} to {max(apart):.2f})")
        key = name.replace(",", "").replace(" ", "-")
        kept[key] = Figure(rms(apart), scatter=float(np.std(apart)) or None)
    chance = np.sqrt(2 / given.seeds)
    print(f"in the mean of {given.seeds} seeds, by chance {chance:.2f}:", end="")
    print(f" {(in_mean := rms((profile - cyclic).mean(0))):.2f}")
    kept |= {"in-the-mean": Figure(in_mean), "in-the-mean-by-chance": Figure(chance)}
    for name, rows in (("profile", profile), ("cyclic", cyclic)):
        off = rows - truth
        print(f"{name} position from the truth: {rms(off):.2f}, mean {rms(off.mean(0)):.2f}")
        each = [rms(one) for one in off]
        kept[f"{name}-from-the-truth"] = Figure(rms(each), scatter=float(np.std(each)) or None)
        kept[f"{name}-mean-from-the-truth"] = Figure(rms(off.mean(0)))
    command = f"python benchmarks/cyclic_only.py --first {given.first} --seeds {given.seeds}"
    depends = ("hil/estimation", "hil/least_squares", "drivers/cia402", "sim_plant/drive")
    keep("cyclic-only", kept, depends=depends, command=command, seeds=seeds)


if __name__ == "__main__":
    main()
