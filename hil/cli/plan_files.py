"""Files of a plan: reading with robot and workspace, validation, writing."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from hil.model.robot import ROBOTS
from hil.planning.plan import dump_plan, load_workspace, opened_plan, remarks
from hil.runs.atomic_file import write_file
from hil.show.rounding import count
from hil.terminal.console import give, say

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.planning.workspace import Workspace


def load(plan_file: Path, robot_file: str | None, workspace: Path | None) -> tuple[Plan, Robot]:
    """Read a plan with robot and workspace; show remarks about the workspace.

    Raises
    ------
    FileError
        One of the files cannot be used, or the plan is of another robot.
    """
    the_plan, the_robot = opened_plan(plan_file, robot_file, workspace)
    _show_remarks(the_plan.workspace, the_robot)
    return the_plan, the_robot


def load_guard(path: Path | None, robot: Robot) -> Workspace | None:
    """Read the optional workspace of a new plan; show remarks.

    Raises
    ------
    FileError
        An unusable workspace file.
    """
    guard = None if path is None else load_workspace(path, robot)
    _show_remarks(guard, robot)
    return guard


def _show_remarks(workspace: Workspace | None, robot: Robot) -> None:
    """Print remarks about an accepted workspace."""
    for line in remarks(workspace, robot):
        say(line, style="yellow")


def write_plan(output: Path, designed: Plan, the_robot: Robot) -> None:
    """Write a plan with the path of the robot file, and state the number of measurements."""
    source = Path(the_robot.source)
    if source.parent != ROBOTS:
        file = Path(os.path.relpath(source.resolve(), output.resolve().parent)).as_posix()
        remembered = designed.robot.model_copy(update={"file": file})
        designed = designed.model_copy(update={"robot": remembered})
    write_file(output, dump_plan(designed).encode())
    give(plan=str(output), measurements=len(designed.measurements))
    say(f"{count(len(designed.measurements), 'measurement')} in {output}")
