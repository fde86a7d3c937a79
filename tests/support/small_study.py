"""Study of small manual plans, whose campaigns take seconds; designing would take minutes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from small_run import COUNTS, write_run

from benchmarks.drift_study.campaigns import PERIOD
from benchmarks.drift_study.drift import prepare
from hil.planning.design.by_counts import design
from hil.planning.design.friction import sweep
from hil.planning.design.trajectories import Basis
from hil.planning.plan import Plan, PlannedRobot, dump_plan

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from benchmarks.drift_study.cell import Cell
    from benchmarks.drift_study.drift import Done
    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory

PLANT = "manutec-r15"
SEEDS = (1, 2)


def some_trajectory(robot: Robot, seed: int = 0, period: float = PERIOD) -> Trajectory:
    """Return a trajectory within the limits, without any optimisation."""
    basis = Basis(robot, period)
    return basis.trajectory(basis.random(np.random.default_rng(seed)), 1, f"t{seed + 1}")


def planned(robot: Robot, *measurements: object) -> Plan:
    identity = PlannedRobot(name=robot.name, digest=robot.digest)
    return Plan(robot=identity, measurements=measurements)


def small_plans(robot: Robot) -> dict[str, Plan]:
    """Return campaigns of one to eight minutes."""
    wave = some_trajectory(robot, period=5.0)
    speeds = sweep(robot, speeds=3, slowest=0.2).measurements
    cold = [measurement.model_copy(update={"exercise": None}) for measurement in speeds]
    strokes = design(robot, COUNTS)
    return {
        "two-step": strokes,
        "mixed": planned(robot, *strokes.measurements[:4], wave),
        "trajectory": planned(robot, wave),
        "compensated": planned(robot, *cold, wave),
        "warmed": planned(robot, wave),
    }


def put(plans: dict[str, Plan], folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    for kind, plan in plans.items():
        (folder / f"{kind}.yaml").write_text(dump_plan(plan))
    return folder


def opened(folder: Path, **others: object) -> list[Cell]:
    arguments = {"robot": PLANT, "plant": PLANT, "seeds": SEEDS, "scenarios": ["on"], **others}
    return prepare(folder, **arguments)


def begun(folder: Path, robot: Robot) -> list[Cell]:
    """Return the cells of a study; the campaigns of its two-step cells are measured already."""
    cells = opened(put(small_plans(robot), folder))
    for cell in (cell for cell in cells if cell.kind == "two-step"):
        cell.run.parent.mkdir(parents=True, exist_ok=True)
        write_run(cell.run, robot, seed=cell.seed)
    return cells


def cell_of(folder: Path, kind: str, seed: int) -> Cell:
    return next(c for c in opened(folder) if (c.kind, c.seed) == (kind, seed))


def here(function: Callable[[Cell], object], jobs: Iterable[Cell]) -> Iterator[tuple[Cell, object]]:
    """Execute tasks in this process, one after the other."""
    for job in jobs:
        try:
            yield job, function(job)
        except Exception as error:  # like a pool of processes
            yield job, error


def errors_of(done: Iterable[Done]) -> dict[tuple[str, str], str]:
    return {(each.step, str(each.cell)): each.error for each in done}
