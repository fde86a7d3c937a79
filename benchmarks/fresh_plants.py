"""Judgements on unseen plants, each with one property of real machines.

Every seed is a different plant (`torque_intervals.write_plant`): bodies, friction, noise.
Properties, on all axes or on an axis chosen by the seed: encoders of 256 to 1024 increments, gears
of 25 to 80 Hz, backlash of 0.5 to 2 mrad, a SYNC period of 4 to 16 ms, a torque constant 2 % off.
Backlash and the torque constant are true causes; any other named cause is a false one::

    python benchmarks/fresh_plants.py [PROPERTY ...] [--first 3101] [--seeds 5] [--runs FOLDER]

A run counts as right if the true cause is named (alone or first), or if no cause is named. The
verdict *failed* is wrong if all torques are correct within 1 %. Plants with a drive fault are
skipped.
"""

from __future__ import annotations

import argparse
import math
import re
import shutil
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import yaml
from accuracy import DEPENDS, ROBOT, SIDE_BY_SIDE, hil
from excluded import NAMED, PLAN
from excluded_cases import Case, changed, judged
from figures import Figure, keep
from planted_flaws import PLANTS, RECORDED
from refresh import copied
from torque_intervals import write_plant

from hil.ground_truth.true_parameters import true_parameters
from hil.model.robot import ROBOTS
from hil.runs.pooling import Pooled
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Iterator

    from excluded_cases import Said

EXACT = 0.01
"""Largest torque error on every axis for which the verdict *failed* is wrong."""
DEGREES = math.degrees(1e-3)
"""One milliradian [degrees]."""


class Property(NamedTuple):
    """Property of plants: permitted cause in the result, and sizes in the units of the cause."""

    cause: str
    sizes: tuple[float, ...]


PROPERTIES = {
    "torque constant error, %:": Property("torque constant", (2,)),
    "SYNC, ms:": Property("", (4, 8, 16)),
    "encoder increments:": Property("encoders", (256, 512, 1024)),
    "gears, Hz:": Property("gears", (25, 45, 80)),
    "backlash, mrad:": Property("backlash", (0.5, 1.0, 2.0)),
}


class Trial(NamedTuple):
    """Plant with a seed and a property of some size."""

    what: str
    size: float
    seed: int

    @property
    def case(self) -> Case:
        """Case for the judgement by `excluded_cases`."""
        cause = PROPERTIES[self.what].cause
        axis = 1 + self.seed % 6 if cause in ("backlash", "torque constant") else 0
        size = self.size / 2 * DEGREES if cause == "backlash" else self.size
        return Case("", cause, axis, 1.0, size, self.seed)


def measure(folder: Path, trial: Trial) -> Path | None:
    """Measure the plan on the trial's plant, unless the run exists; return the run's folder.

    None if a drive faults.
    """
    case, period = trial.case, 1
    run = folder / re.sub(r"\W+", "-", f"{trial.what}-{trial.size:g}-{trial.seed}")
    plant, plan = run.with_suffix(".plant.yaml"), folder / "plan.yaml"
    drives = ROBOTS / f"{ROBOT}.drives.yaml"
    if run.exists():
        return run
    write_plant(plant, trial.seed)
    if change := PLANTS.get(case.cause):
        content = yaml.safe_load(plant.read_text())
        change(content, case.axis, case.size)
        content["step"] = 0.0005  # some of these arms swing fast on their gears
        plant.write_text(yaml.safe_dump(content, sort_keys=False))
    if case.cause == "encoders":
        stated = drives.read_text().replace("revolution: 4096", f"revolution: {trial.size:g}")
        (drives := run.with_suffix(".drives.yaml")).write_text(stated)
    if trial.what.startswith("SYNC"):
        period = round(trial.size / 4)
        copied(plan, "sample_period", period, plan := run.with_suffix(".plan.yaml"))
        copied(drives, "sync_period", period, drives := run.with_suffix(".drives.yaml"))
    try:
        hil("run", plan, "-o", run, "--channel", plant, "--drives", drives,
            "--bus-option", f"seed={trial.seed}")  # fmt: skip
    except SystemExit as error:
        shutil.rmtree(run, ignore_errors=True)
        print(f"{run.name}: {str(error).strip().splitlines()[0]}", flush=True)
        return None
    return run


def outcome(folder: Path, trial: Trial) -> Said | None:
    """Identify a trial, and judge the result by the truth; return None after a fault of a drive."""
    case, at = trial.case, measure(folder, trial)
    if at is None:
        return None
    run = Run.open(at)
    recorded = list(Pooled([run]))
    if change := RECORDED.get(case.cause):
        recorded = changed(recorded, change, case.axis - 1, case.size)
    return judged(run, run.robot, recorded, true_parameters(run.robot, f"{at}.plant.yaml"))


def trials(names: list[str], first: int, seeds: int) -> Iterator[Trial]:
    """Yield every property and size, each with different seeds."""
    for what, each in PROPERTIES.items():
        for number, size in enumerate(each.sizes):
            if what in names:
                own = first + seeds * number
                yield from (Trial(what, size, seed) for seed in range(own, own + seeds))
        first += seeds * len(each.sizes)


def main() -> None:
    """Measure, identify, print and keep."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("properties", nargs="*", default=list(PROPERTIES), metavar="PROPERTY")
    parser.add_argument("--first", type=int, default=3101)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--runs", type=Path, default=Path("build/fresh-plants"))
    given = parser.parse_args()
    folder = given.runs.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "plan.yaml").exists():
        hil("plan", ROBOT, "-o", folder / "plan.yaml", *PLAN)
    every = list(trials(given.properties, given.first, given.seeds))
    right: dict[str, list[bool]] = {}
    too_low = wrong = 0
    with ProcessPoolExecutor(SIDE_BY_SIDE) as pool:
        for trial, said in zip(every, pool.map(partial(outcome, folder), every), strict=True):
            if said is None:
                continue
            named = said.named(trial.case)
            right.setdefault(f"{trial.what} {trial.size:g}", []).append(named != NAMED[3])
            too_low += said.word == "failed" and said.error <= EXACT
            wrong += not said.honest
            first = f"{said.found[0]}"[:150] if said.found else ""
            about = f"{trial.what} {trial.size:g} | {trial.seed}, axis {trial.case.axis}"
            print(f"| {about} | {named} | {first} | {said.word} | {100 * said.error:.2f} % |",
                  flush=True)  # fmt: skip
    for name, own in right.items():
        print(f"{name}: right or none in {sum(own)} of {len(own)}")
    n, good = sum(map(len, right.values())), sum(map(sum, right.values()))
    print(f"all: {good} of {n}; failed with torques right within 1 %: {too_low};"
          f" good with 3 times the stated error: {wrong}")  # fmt: skip
    kept = {"runs": Figure.count(n), "right": Figure.count(good), "too-low": Figure.count(too_low),
            "good-and-wrong": Figure.count(wrong)}  # fmt: skip
    command = f"python benchmarks/fresh_plants.py --first {given.first} --seeds {given.seeds}"
    keep("fresh-plants", kept, depends=DEPENDS, command=command, seeds=[given.first])


if __name__ == "__main__":
    main()
