"""Coverage of the intervals by each covariance rule, on many plants.

Every seed is a plant with other noise and friction, measured and identified by the improved method.
For each rule the table has the share of 95 % intervals that hold the truth, and their median width
relative to the standard error for white noise::

    python benchmarks/covariances.py [KIND ...] [--first 801] [--seeds 11] [--runs FOLDER]

Kinds are strokes, trajectories, load (4 kg, unknown to the robot file), coarse (the same load, with
encoders of 512 counts per motor turn) and drift (strokes, with three times the drift of friction).
The default rule, CR2, has the narrowest intervals with correct coverage for all kinds. It was
chosen on seeds 801 to 811 (strokes, trajectories, load) and 901 to 907 (drift).
"""

from __future__ import annotations

import argparse
import re
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml
from figures import Figure, keep
from golden import LIGHT, MANUTEC, PLANS, must

from hil.estimation.intervals import half_width
from hil.estimation.two_step_methods import covariance_of_gears, joint, prepare
from hil.ground_truth.true_parameters import true_parameters
from hil.least_squares.uncertainty import effective_degrees, leave_out
from hil.model.robot import ROBOTS
from hil.runs.pooling import Pooled
from hil.runs.run import Run
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    from hil.arrays import Mask

KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "strokes": ("rough", {}),
    "trajectories": ("periodic", {}),
    "load": ("periodic", {"payload": LIGHT}),
    "coarse": ("periodic", {"payload": LIGHT}),
    "drift": ("rough", {"drift_strength": 3.0}),
}
"""Plan of `golden` and further keys of the plant, by kind."""
COARSE = 512
"""Resolution of the coarse encoders, in place of 4096 [counts per motor turn]."""
RULES = ("jackknife", "clusters", "CR2", "white")


def measured(folder: Path, kind: str, seed: int) -> tuple[Run, Path]:
    """Return run and plant of one seed, recorded if missing."""
    plan, differs = KINDS[kind]
    plant, run = folder / f"{kind}.plant.yaml", folder / f"{kind}-{seed}"
    drives = folder / f"{kind}.drives.yaml"
    if not (folder / f"{plan}.yaml").exists():
        command, *rest = PLANS[plan]
        must(folder, command, *rest, "-o", f"{plan}.yaml")
    if not run.exists():
        content = load_plant_file(MANUTEC).model_dump(mode="json") | differs
        stated = yaml.safe_load((ROBOTS / f"{MANUTEC}.drives.yaml").read_text())
        if kind == "coarse":
            for axis, own in zip(content["axes"], stated["axes"], strict=True):
                axis["drive"] |= {"increments": COARSE, "zero": 0}
                own |= {"increments_per_revolution": COARSE, "zero": 0}
        drives.write_text(yaml.safe_dump(stated, sort_keys=False))
        plant.write_text(yaml.safe_dump(content, sort_keys=False))
        must(folder, "run", f"{plan}.yaml", "-o", run, "--channel", plant, "--drives", drives,
             "--bus-option", f"seed={seed}")  # fmt: skip
    return Run.open(run), plant


def judged(run: Run, plant: Path) -> Iterator[tuple[str, Mask, float]]:
    """Return coverage by each rule, and median widths relative to white noise."""
    robot, truth = run.robot, true_parameters(run.robot, plant)
    raw, _ = prepare(Pooled([run]))
    found, n = joint(robot, raw), len(truth)
    regression, p = found.solver.regression, found.solver.solve()
    beside = found.drive_train.covariance + covariance_of_gears(robot, raw, found.drive_train, p)
    change, of_steps = found.solver.steps()
    p, beside = p + change, beside + of_steps
    white = np.sqrt(np.diag(regression.uncertainty("white").covariance)[:n])
    for rule in RULES:
        error = regression.uncertainty(rule)
        degrees = {rule: error.degrees_of_freedom[:n]}
        if rule == "jackknife":
            equations, x = regression.normal, regression.solution[regression.kept]
            changes = leave_out(equations.N, equations.scores(x))[:, :n]
            degrees[f"{rule}, degrees by squares"] = effective_degrees(changes**2)
        variance = np.diag(error.covariance[:n, :n] + beside)
        for name, each in degrees.items():
            half = half_width(variance, np.zeros(n), each, 0.95)
            yield name, np.abs(p - truth) <= half, float(np.median(half / white))


def main() -> None:
    """Measure, identify and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("kind", nargs="*", help=f"of {', '.join(KINDS)}; all by default")
    parser.add_argument("--first", type=int, default=801)
    parser.add_argument("--seeds", type=int, default=11)
    parser.add_argument("--runs", type=Path, default=Path("build/coverage"))
    given = parser.parse_args()
    folder = given.runs.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    seeds = range(given.first, given.first + given.seeds)
    for kind in given.kind or KINDS:
        kept: dict[str, Figure] = {}
        holds: dict[str, list[Mask]] = defaultdict(list)
        widths: dict[str, list[float]] = defaultdict(list)
        for seed in seeds:
            for rule, inside, width in judged(*measured(folder, kind, seed)):
                holds[rule].append(inside)
                widths[rule].append(width)
        print(kind)
        for rule, found in holds.items():
            every, wide = np.concatenate(found), np.array(widths[rule])
            print(
                f"  {rule:32s} {every.sum()} of {every.size}: {every.mean():.1%},"
                f" width {wide.mean():.1f}",
                flush=True,
            )
            name = re.sub(r"\W+", "-", rule)
            kept[f"{name}-holds"] = Figure(100 * every.mean(), "%", 3)
            kept[f"{name}-width"] = Figure(wide.mean(), "times", scatter=wide.std() or None)
        kept["intervals"] = Figure.count(every.size)
        command = f"python benchmarks/covariances.py {kind} --first {given.first}"
        command += f" --seeds {given.seeds}"
        depends = ("hil/estimation", "hil/least_squares", "hil/friction", "sim_plant/physics")
        keep(f"covariances-{kind}", kept, depends=depends, command=command, seeds=seeds)


if __name__ == "__main__":
    main()
