"""Identification from foreign strokes of one axis at a time, against the truth.

Each seed is a virtual twin with drifting friction. Strokes are measured over CAN frames, written as
CSV files of positions and torques only, imported with one map per file, and identified by three
methods: for imported strokes, for strokes measured by hil, and for free motions::

    python benchmarks/back_and_forth.py [tests/robots/pan-tilt.yaml] [--strokes smooth]
        [--seeds 10]

Strokes are the trapezoids of gravity and inertia measurements by `hil plan`, or smooth strokes that
are a fifth faster backward than forward. Errors are torque errors on a free motion
(`hil.ground_truth.comparison`) by identified and by unidentified parameters, relative to the
torque.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import yaml
from figures import ROOT, Figure, keep

from hil.errors import HilError
from hil.estimation.back_and_forth import NAME
from hil.estimation.free_motion.variants import DEFAULT
from hil.estimation.identify import estimate
from hil.ground_truth.true_parameters import true_parameters
from hil.imports.importing import import_recordings
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot
from hil.planning.design.by_counts import design
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.plan import Plan, PlannedRobot, dump_plan
from hil.planning.trajectory import Trajectory
from hil.results.prediction import FreeTorques
from hil.runs.run import Run
from sim_plant.twin.write import write_twin

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate

    Array = NDArray[np.float64]

SMOOTH = 8
"""Number of configurations of each axis with smooth strokes."""
PAN_TILT = ROOT / "tests" / "robots" / "pan-tilt.yaml"
FIRST_SEED = 201
IMPROVED = "improved"
"""Method for strokes measured by hil, with a separate friction law for each recording."""


def strokes(robot: Robot, kind: str) -> Plan:
    """Return a plan of strokes of one axis at a time."""
    if kind == "smooth":
        measurements = tuple(_smooth(robot))
        return Plan(
            robot=PlannedRobot(name=robot.name, digest=robot.digest), measurements=measurements
        )
    groups = base_parameters(robot).groups
    counts = {name: max(8, 2 * len(groups[kind.group])) for name, kind in ELEMENT_KINDS.items()}
    plan = design(robot, counts)
    own = tuple(m for m in plan.measurements if m.kind in ("gravity", "inertia"))
    return plan.model_copy(update={"measurements": own})


def _smooth(robot: Robot) -> Iterator[Trajectory]:
    """Return strokes without corners of each axis at some configurations, the way back faster."""
    rng = np.random.default_rng(7)
    for axis in range(robot.n_joints):
        for number in range(SMOOTH):
            share = rng.uniform(0.3, 0.7, robot.n_joints)
            q = robot.q_min + share * (robot.q_max - robot.q_min)
            way = 0.18 * min(robot.q_max[axis] - robot.q_min[axis], 4.0)
            speed, acceleration = robot.velocity_limit[axis], robot.acceleration_limit[axis]
            # amplitude of a cosine with its second harmonic
            slowest = max(10.0 * way / speed, np.sqrt(210.0 * way / acceleration))
            period = 0.02 * np.ceil(50.0 * slowest * rng.uniform(1.0, 2.0))
            sine, cosine = np.zeros((robot.n_joints, 2)), np.zeros((robot.n_joints, 2))
            cosine[axis] = -way, way / 4
            sine[axis] = 0.1 * way, -0.05 * way
            yield Trajectory(
                id=f"s{axis + 1}-{number + 1}", q=tuple(q.round(4).tolist()), period=float(period),
                sine=tuple(map(tuple, sine.tolist())), cosine=tuple(map(tuple, cosine.tolist())),
                cycles=6,
            )  # fmt: skip


def measured(plan: Path, twin: Path, seed: int, folder: Path) -> Run:
    """Return the run of the plan on the plant of a seed, recorded if missing."""
    run = folder / f"seed-{seed}"
    if not run.exists():
        channel = "--channel", twin / "plant.yaml", "--drives", twin / "drives.yaml"
        arguments = "run", plan, "-o", run, *channel, "--bus-option", f"seed={seed}"
        done = subprocess.run(
            [sys.executable, "-m", "hil", *map(str, arguments)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            sys.exit(done.stderr)
    return Run.open(run)


def exported(run: Run, folder: Path, *, strokes: bool = True, every: int = 1) -> Run:
    """Return the recordings of strokes or of a motion as imported from CSV files.

    Only every `every`-th sample is kept, as from a slower controller.
    """
    if (folder / "run").exists():
        return Run.open(folder / "run")
    folder.mkdir(parents=True)
    (folder / "robot.yaml").write_text(run.robot.text)
    maps = []
    for number, (measurement, recording) in enumerate((m.measurement, m.recording) for m in run):
        axis = int(np.argmax(np.ptp(recording.q, axis=0)))
        columns = np.column_stack([recording.time, recording.q, recording.tau])
        names = ["t", *(f"{x}{j + 1}" for x in "qm" for j in range(recording.n_joints))]
        np.savetxt(folder / f"r{number}.csv", columns[::every], "%.10g", ",",
                   header=",".join(names), comments="")  # fmt: skip
        joints = [
            {
                "position": {"column": f"q{j + 1}", "unit": "rad" if turns else "m"},
                "torque": {"column": f"m{j + 1}", "unit": "N m" if turns else "N"},
            }
            for j, turns in enumerate(run.robot.revolute)
        ]
        content = {
            "robot": "robot.yaml", "files": [f"r{number}.csv"], "joints": joints,
            "time": {"column": "t", "unit": "s"},
        }  # fmt: skip
        if strokes:
            content |= {"kind": {"back_and_forth": axis + 1}, "accept": ["still", "friction"]}
        maps.append(folder / f"{measurement.id}.yaml")
        maps[-1].write_text(yaml.safe_dump(content))
    return import_recordings(maps, folder / "run")


class Judged(NamedTuple):
    """Torque errors [%], numbers of covering and of all intervals, relative width."""

    wrong: float
    missing: float
    inside: int
    of: int
    half: float


def judged(run: Run, plant: Path, method: str) -> Judged:
    """Return errors and coverage of one method.

    Raises
    ------
    HilError
        Refusal by the method.
    """
    found = estimate(run.robot, [(m.measurement, m.recording) for m in run], method)
    truth = true_parameters(run.robot, plant)
    shown, kept = identified(found, truth)
    free = FreeTorques(run.robot)
    rms = free.rms(truth)
    wrong, missing = (
        100 * float(np.nanmean(free.rms(x) / rms)) for x in (found.values - shown, truth - shown)
    )
    inside = (np.abs(found.values - shown) <= found.half_width())[kept]
    half = np.median((found.half_width() / np.abs(found.values - shown).clip(1e-12))[kept])
    return Judged(wrong, missing, int(inside.sum()), int(kept.sum()), float(half))


def identified(found: Estimate, truth: Array) -> tuple[Array, Array]:
    """Return the true values of the estimated parameters, and a mask of the identified ones."""
    if found.combination is None:
        return truth, np.ones(len(truth), dtype=bool)
    return found.combination @ truth, np.diag(found.combination) > 0


def main() -> None:
    """Measure, identify and judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot", type=Path, nargs="?", default=PAN_TILT)
    parser.add_argument("--strokes", choices=("trapezoids", "smooth"), default="trapezoids")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=FIRST_SEED)
    parser.add_argument("--keep", type=Path, help="folder for runs, which are not made again")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        twin, plan = folder / "twin", folder / "plan.yaml"
        robot = Robot.load(options.robot)
        if not plan.exists():
            write_twin(options.robot, twin)
            (folder / "robot.yaml").write_text(robot.text)
            chosen = strokes(robot, options.strokes)
            own = chosen.robot.model_copy(update={"file": "robot.yaml"})
            plan.write_text(dump_plan(chosen.model_copy(update={"robot": own})))
        found: dict[str, list[Judged]] = {NAME: [], IMPROVED: [], DEFAULT: []}
        seeds = range(options.first, options.first + options.seeds)
        for seed in seeds:
            run = exported(measured(plan, twin, seed, folder), folder / f"csv-{seed}")
            for method, every in found.items():
                try:
                    every.append(each := judged(run, twin / "plant.yaml", method))
                except HilError as error:
                    print(f"seed {seed}, {method}: {error}")
                    continue
                print(
                    f"seed {seed}, {method}: torques wrong by {each.wrong:.3f} %, not identified"
                    f" {each.missing:.2f} %; inside {each.inside} of {each.of}, half-width over"
                    f" error {each.half:.2g}"
                )
    kept: dict[str, Figure] = {}
    for method, every in found.items():
        name = method.replace(" ", "-")
        kept[f"{name}-refused"] = Figure.count(options.seeds - len(every))
        if not every:
            continue
        wrong, missing, inside, of, half = np.array(every).T
        kept |= {
            f"{name}-torque": Figure(wrong.mean(), "%", scatter=wrong.std() or None),
            f"{name}-not-identified": Figure(missing.mean(), "%", scatter=missing.std() or None),
            f"{name}-inside": Figure.count(int(inside.sum())),
            f"{name}-intervals": Figure.count(int(of.sum())),
            f"{name}-half-over-error": Figure(half.mean(), scatter=half.std() or None),
        }
    robot = "" if options.robot == PAN_TILT else f"{options.robot} "
    command = f"python benchmarks/back_and_forth.py {robot}--strokes {options.strokes}"
    command += f" --first {options.first} --seeds {options.seeds}"
    name = f"back-and-forth-{options.robot.stem}-{options.strokes}"
    keep(name, kept, depends=("hil/estimation", "hil/imports"), command=command, seeds=seeds)


if __name__ == "__main__":
    main()
