"""Study of the paper's claim: influence of drift on each way of identification, over many plants.

Every seed is another plant. In each scenario (`scenarios`) the plant is measured by each kind of
campaign for the same time (`campaigns`), and every method's estimate is compared with the truth
(`cell`). All campaigns are measured before any is judged, since friction "of another session" is
taken from another campaign. Existing results are not computed again.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from checked_files.yaml_file import FileError
from hil.ground_truth.true_parameters import true_parameters
from hil.model.robot import ROBOTS, Robot
from hil.runs.atomic_file import file_errors, own_folder, write_file

from .campaigns import KINDS, campaigns
from .cell import Cell, judge, measure
from .scenarios import SCENARIOS, write_plant

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.execution import Execute

    from .cell import Outcome

SETTINGS = "study.json"


@dataclass(frozen=True, slots=True)
class Done:
    """Event of a finished or failed job.

    Attributes
    ----------
    cell : Cell
    step : {"measured", "judged"}
    error : str
        Message of a failed job; empty otherwise.
    done, of : int
        Number of finished jobs, and of all jobs of this step.
    """

    cell: Cell
    step: str
    error: str
    done: int
    of: int


@dataclass(frozen=True, slots=True)
class Judged:
    """Outcomes of all methods for one campaign."""

    cell: Cell
    outcomes: tuple[Outcome, ...]


def prepare(
    folder: Path,
    robot: str,
    plant: str,
    seeds: Sequence[int],
    scenarios: Sequence[str],
    kinds: Sequence[str] = KINDS[:-1],
    share: float = 1.0,
    drives: Path | None = None,
    minutes: float | None = None,
) -> list[Cell]:
    """Create or open the folder of a study, and return its campaigns.

    Parameters
    ----------
    robot : str
        Name, or path of a robot file.
    plant : str
        Plant file from which all scenarios are derived, or name of a built-in plant.
    share : float
        Share of the designed plan's measurements.
    drives : path, optional
        Drives file of the plant; by default the built-in one of the robot.
    minutes : float, optional
        Duration of every campaign, see `campaigns`; `share` is then ignored [min].

    Raises
    ------
    FileError
        The folder is of another study, the plant is missing or another robot's, the drives file is
        missing, or the disk is full.
    """
    the_robot = Robot.load(robot)
    drives = drives or ROBOTS / f"{the_robot.name}.drives.yaml"
    if not drives.exists():
        raise FileError(f"{drives}: is no drives file; give one for {robot} with --drives")
    true_parameters(the_robot, plant)  # refuse plants without a truth for the comparison at once
    folder.mkdir(parents=True, exist_ok=True)
    settings = {"robot": the_robot.digest, "plant": plant, "share": share, "minutes": minutes}
    _keep(folder / SETTINGS, settings)
    write_file(folder / "robot.yaml", the_robot.text.encode())
    with file_errors(drives, "read"):
        text = drives.read_bytes()
    write_file(folder / "drives.yaml", text)
    for name in scenarios:
        own_folder(folder / name)
        write_plant(SCENARIOS[name], plant, folder / name / "plant.yaml")
    campaigns(the_robot, share, folder, minutes)
    return [
        Cell(folder.resolve(), scenario, kind, seed, seeds[k - 1 if k else 1])
        for k, seed in enumerate(seeds)
        for scenario in scenarios
        for kind in kinds
    ]


def measure_cells(cells: Sequence[Cell], execute: Execute[Any, Any]) -> Iterator[Done]:
    """Measure all campaigns, then judge them."""
    measured = set(cells)
    for step, function in (("measured", measure), ("judged", judge)):
        jobs = [cell for cell in cells if cell in measured]
        for count, (cell, result) in enumerate(execute(function, jobs), start=1):
            error = ""
            if isinstance(result, Exception):
                measured.discard(cell)
                error = str(result) or type(result).__name__
            yield Done(cell, step, error, count, len(jobs))


def judged(cells: Sequence[Cell]) -> list[Judged]:
    """Return the existing outcomes."""
    return [Judged(cell, tuple(judge(cell))) for cell in cells if cell.verdict.exists()]


def _keep(path: Path, settings: dict[str, Any]) -> None:
    """Write the description of a study, or refuse the folder of another study."""
    if not path.exists():
        write_file(path, json.dumps(settings, indent=1).encode())
        return
    then = json.loads(path.read_text())
    for key, now in settings.items():  # folders of earlier versions have no duration
        if (before := then.get(key)) != now:
            raise FileError(
                f"{path}: {key} was {_shown(before)} and is {_shown(now)} now; give the study a"
                " folder of its own"
            )


def _shown(value: object) -> str:
    return "not given" if value is None else str(value)
