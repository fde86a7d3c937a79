"""Campaign on one plant: measurement by `hil run`, assessment by all suitable methods.

Each campaign is a separate process. So any figure can be reproduced by the same command, and a
failed campaign does not affect the others. Outcomes are kept in a small file; the recordings stay
in place.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from benchmarks.rivals.products import stack
from benchmarks.rivals.variants import (
    COMPENSATED,
    SLOW,
    VARIANTS,
    estimate_of,
    trajectories,
)
from checked_files.yaml_file import FileError
from hil.commands.friction import fit_friction
from hil.estimation.identify import estimate
from hil.ground_truth.comparison import Comparison
from hil.ground_truth.true_parameters import true_parameters
from hil.runs.atomic_file import own_folder, write_file
from hil.runs.pooling import recorded
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from benchmarks.rivals.products import Stacked
    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

OUR_DEFAULT = "two-step, improved"


@dataclass(frozen=True, slots=True)
class Cell:
    """A campaign of a study.

    Attributes
    ----------
    study : Path
    scenario, kind : str
    seed : int
    other : int
        Seed of the session with the friction measured earlier.
    """

    study: Path
    scenario: str
    kind: str
    seed: int
    other: int

    @property
    def run(self) -> Path:
        """Folder of the campaign's run."""
        return self._run(self.seed)

    @property
    def earlier_run(self) -> Path:
        """Folder of the run in the other session."""
        return self._run(self.other)

    @property
    def plant(self) -> Path:
        """Plant file of the campaign."""
        return self.study / self.scenario / "plant.yaml"

    @property
    def plan(self) -> Path:
        """Plan file of the campaign."""
        return self.study / f"{self.kind}.yaml"

    @property
    def verdict(self) -> Path:
        """File of the outcomes."""
        return self.study / self.scenario / self.kind / f"seed-{self.seed}.json"

    def __str__(self) -> str:
        return f"{self.scenario}, {self.kind}, seed {self.seed}"

    def _run(self, seed: int) -> Path:
        return self.study / self.scenario / self.kind / f"seed-{seed}"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Errors of one method in one campaign.

    Attributes
    ----------
    method : str
    group_error : dict
        See `hil.ground_truth.comparison.Comparison`.
    torque_error : float
        Mean over joints, relative.
    inside, n : int
        Number of parameters with the truth inside the interval of 95 %, and of all parameters.
    error : list of float
        Errors of all parameters.
    """

    method: str
    group_error: dict[str, float]
    torque_error: float
    inside: int
    n: int
    error: list[float]


def measure(cell: Cell) -> None:
    """Measure the missing parts of a campaign.

    Raises
    ------
    FileError
        The campaign did not end; the message is that of `hil run`.
    """
    begun = (cell.run / "run.json").exists()
    if begun and not Run.open(cell.run).missing:
        return
    own_folder(cell.run.parent)
    robot = cell.study / "robot.yaml"
    command = [
        *(sys.executable, "-m", "hil", "run", cell.plan, "-o", cell.run, "--robot", robot),
        *("--drives", cell.study / "drives.yaml"),
        *("--channel", cell.plant, "--bus-option", f"seed={cell.seed}"),
        *(("--resume",) if begun else ()),
    ]
    done = subprocess.run(
        [str(part) for part in command],
        stdin=subprocess.DEVNULL,  # with a terminal, the process would read keys
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise FileError(f"{cell}: {done.stderr.strip() or f'ended with {done.returncode}'}")


def judge(cell: Cell) -> list[Outcome]:
    """Estimate by all suitable methods and compare with the truth; the result is kept in a file."""
    if cell.verdict.exists():
        return [Outcome(**each) for each in json.loads(cell.verdict.read_text())]
    folder = Run.open(cell.run)
    truth = true_parameters(folder.robot, cell.plant)
    found = [
        _outcome(name, estimate, truth) for name, estimate in _METHODS[cell.kind](cell, folder)
    ]
    text = json.dumps([asdict(each) for each in found], indent=1)
    write_file(cell.verdict, text.encode())
    return found


def _outcome(name: str, estimate: Estimate, truth: Array) -> Outcome:
    found = Comparison(estimate, truth)
    return Outcome(
        method=name,
        group_error={group: float(error) for group, error in found.group_error.items()},
        torque_error=found.mean_torque_error,
        inside=int(found.inside.sum()),
        n=len(found.inside),
        error=found.difference.tolist(),
    )


def _two_step(_cell: Cell, folder: Run) -> Iterator[tuple[str, Estimate]]:
    measured = list(recorded(folder))
    for method in ("improved", "published"):
        yield f"two-step, {method}", estimate(folder.robot, measured, method)


def _mixed(_cell: Cell, folder: Run) -> Iterator[tuple[str, Estimate]]:
    yield "mixed, improved", estimate(folder.robot, list(recorded(folder)))


def _jointly(_cell: Cell, folder: Run) -> Iterator[tuple[str, Estimate]]:
    """Yield names and estimates of methods with friction in the regression.

    The variants of conventional identification share the stacked data. The estimator of `hil` is
    included.
    """
    yield "trajectory, improved", estimate(folder.robot, list(recorded(folder)))
    measured = trajectories(recorded(folder))
    stacked: dict[float, Stacked] = {}
    for name, variant in VARIANTS.items():
        if variant.slowest not in stacked:
            stacked[variant.slowest] = stack(folder.robot, measured, variant.slowest)
        yield (
            f"jointly: {name}",
            estimate_of(folder.robot, stacked[variant.slowest], variant, name),
        )


def _beforehand(cell: Cell, folder: Run) -> Iterator[tuple[str, Estimate]]:
    """Yield estimates with friction as measured in the same session, and in another session."""
    warm = " after warm-up" if cell.kind == "warmed" else ""
    measured = trajectories(recorded(folder))
    sessions = {"same session": cell.run, "other session": cell.earlier_run}
    for session, run in sessions.items():
        known = _characteristics(run, folder.robot)
        data = stack(folder.robot, measured, SLOW, known)
        for columns, variant in COMPENSATED.items():
            name = ", ".join(filter(None, (f"beforehand{warm}: {session}", columns)))
            yield name, estimate_of(folder.robot, data, variant, name)


def _characteristics(run: Path, robot: Robot) -> list[Callable[[Array], Array]]:
    folder = Run.open(run)
    if folder.missing:  # a kept assessment must be of the complete data
        raise FileError(f"{run}: {folder.shortfall}")
    fits = {each.axis: each.models[each.chosen] for each in fit_friction(folder).axes}
    missing = [str(axis + 1) for axis in range(robot.n_joints) if axis not in fits]
    if missing:
        raise FileError(f"{run}: no friction model of axis {', '.join(missing)}")
    return [fits[axis].torque for axis in range(robot.n_joints)]


_METHODS: dict[str, Callable[[Cell, Run], Iterator[tuple[str, Estimate]]]] = {
    "two-step": _two_step,
    "mixed": _mixed,
    "trajectory": _jointly,
    "compensated": _beforehand,
    "warmed": _beforehand,
}
