"""Effect of each flaw of a plant file on the estimate: a table for the docs.

For each flaw a whole campaign is measured with the same plan and seed. The published and the
improved method are judged against the truth::

    python benchmarks/flaws.py [--seed 3] [--plan PLAN] [--keep FOLDER]

Errors are relative, in the norm of each group of base parameters and as torques on a free motion.
"""

from __future__ import annotations

import argparse
import math
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from accuracy import DEPENDS, ROBOT, hil, judge
from figures import Figure, keep

from hil.runs.run import Run
from sim_plant.plant_file import PlantFile, load_plant_file

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.plant_file import PlantAxis

BIG, HAND = 20.0, 40.0
"""Natural frequencies of axes 1 to 3 and of the hand's axes on their gears, motors blocked [Hz]."""
BACKLASH = 2e-4
"""Backlash [rad]; 0.7 minutes of arc."""
LAG = 0.004
"""Lag of the current reading [s]."""


def every_axis(file: PlantFile, change: Callable[[int, PlantAxis], PlantAxis]) -> PlantFile:
    """Apply a change to every axis of a plant file."""
    axes = tuple(change(k, axis) for k, axis in enumerate(file.axes))
    return file.model_copy(update={"axes": axes})


def drive(axis: PlantAxis, **keys: float) -> PlantAxis:
    """Change keys of a drive."""
    return axis.model_copy(update={"drive": axis.drive.model_copy(update=keys)})


def friction(axis: PlantAxis, **keys: float) -> PlantAxis:
    """Change keys of an axis's friction."""
    return axis.model_copy(update={"friction": axis.friction.model_copy(update=keys)})


def stiffness(k: int, axis: PlantAxis) -> float:
    """Return the stiffness for the natural frequency of an axis [N m/rad]."""
    return axis.drive.load_inertia * (math.tau * (BIG if k < 3 else HAND)) ** 2


def plants() -> dict[str, PlantFile]:
    """Return a plant for each row of the table."""
    file = load_plant_file(ROBOT)
    symmetric = file.model_copy(update={"symmetric": True})
    soft = every_axis(symmetric, lambda k, axis: drive(axis, stiffness=stiffness(k, axis)))
    return {
        "none": symmetric,
        "asymmetric friction, 0.4 to 0.8 %": file,
        "asymmetric friction, 2 to 4 %": every_axis(
            file, lambda _, axis: friction(axis, asymmetry=5 * axis.friction.asymmetry)
        ),
        "friction that grows with load, 5 %": every_axis(
            symmetric, lambda _, axis: friction(axis, load=0.05)
        ),
        f"current {1e3 * LAG:g} ms late": every_axis(
            symmetric, lambda _, axis: drive(axis, current_lag=LAG)
        ),
        f"soft gears, {BIG:g} Hz, hand {HAND:g} Hz": soft,
        f"the same with backlash {1e3 * BACKLASH:g} mrad": every_axis(
            soft, lambda _, axis: drive(axis, backlash=BACKLASH)
        ),
    }


def measure(name: str, file: PlantFile, plan: Path, folder: Path, seed: int) -> Path:
    """Run the campaign on one plant, unless the run exists."""
    stem = "".join(letter if letter.isalnum() else "-" for letter in name)
    run, plant = folder / stem, folder / f"{stem}.yaml"
    if not run.exists():
        plant.write_text(yaml.safe_dump(file.model_dump(mode="json"), sort_keys=False))
        hil("run", plan, "-o", run, "--channel", plant, "--bus-option", f"seed={seed}")
    return run


def main() -> None:
    """Measure, judge and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--plan", type=Path, help="instead of the default one")
    parser.add_argument("--keep", type=Path, help="folder for plants and runs; reused if there")
    given, kept = parser.parse_args(), {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        plan = given.plan or folder / "plan.yaml"
        if not plan.exists():
            hil("plan", ROBOT, "-o", plan)
        for name, file in plants().items():
            run = measure(name, file, plan, folder, given.seed)
            for method, (_, found) in judge(Run.open(run), ["improved", "published"]).items():
                errors = {**found.group_error, "torque": found.mean_torque_error}
                cells = " | ".join(f"{100 * error:.3f}" for error in errors.values())
                print(f"| {name}, {method} | {cells} |", flush=True)
                for what, error in errors.items():
                    key = re.sub(r"\W+", "-", f"{name} {method} {what}")
                    kept[key] = Figure(100 * error, "%")
    command = f"python benchmarks/flaws.py --seed {given.seed}"
    if given.plan:
        command += f" --plan {given.plan}"
    keep("flaws", kept, depends=DEPENDS, command=command, seeds=[given.seed])


if __name__ == "__main__":
    main()
