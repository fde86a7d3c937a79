"""The files of a plan: read with its robot and its workspace, checked, written."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.cli import plan_view
from hil.model.robot import ROBOTS, load_robot, refuse_unknown
from hil.planning.plan import dump_plan, load_plan, refuse_other_robot
from hil.planning.workspace_check import load_workspace, remarks
from hil.runs.atomic_file import write_file
from hil.terminal.console import give, say

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.planning.dry_run import DryRun
    from hil.planning.plan import Plan
    from hil.planning.workspace import Workspace


def load(plan_file: Path, robot_file: str | None, workspace: Path | None) -> tuple[Plan, Robot]:
    """Read a plan, its robot and the workspace that holds for it; show what is strange about it.

    Raises
    ------
    FileError
        One of the files cannot be used, or the plan is of another robot.
    """
    the_plan = load_plan(plan_file)
    the_robot = load_robot(robot_file or _robot_file(the_plan, plan_file))
    refuse_unknown(the_robot)
    refuse_other_robot(the_plan, the_robot, str(plan_file))
    the_plan = _with_workspace(the_plan, the_robot, workspace)
    _show_remarks(the_plan.workspace, the_robot)
    return the_plan, the_robot


def _robot_file(the_plan: Plan, plan_file: Path) -> str | Path:
    """Name of the plan's robot, or path of its file.

    Raises
    ------
    FileError
        The file is not where the plan says.
    """
    if the_plan.robot.file is None:
        return the_plan.robot.name
    path = plan_file.parent / the_plan.robot.file
    if not path.exists():
        raise FileError(
            f"{plan_file}: robot.file: {path} is not there; name the robot file with --robot"
        )
    return path


def load_guard(path: Path | None, robot: Robot) -> Workspace | None:
    """Read the workspace that a new plan keeps to, if any; show what is strange about it.

    Raises
    ------
    FileError
        It cannot be used.
    """
    guard = None if path is None else load_workspace(path, robot)
    _show_remarks(guard, robot)
    return guard


def _with_workspace(the_plan: Plan, the_robot: Robot, path: Path | None) -> Plan:
    """Return the plan with a workspace file's content in place of its own, if one is given."""
    if path is None:
        return the_plan
    return the_plan.model_copy(update={"workspace": load_workspace(path, the_robot)})


def _show_remarks(workspace: Workspace | None, robot: Robot) -> None:
    """Print what is strange about a workspace, though it is accepted."""
    for line in remarks(workspace, robot):
        say(line, style="yellow")


def refuse_problems(result: DryRun, plan_file: Path) -> None:
    """Refuse a plan whose dry run has found problems.

    Raises
    ------
    FileError
        With the problems and their lines in the file.
    """
    if result.problems:
        text = plan_file.read_text(encoding="utf-8")
        raise FileError(plan_view.describe_problems(result, text, str(plan_file)))


def write_plan(output: Path, designed: Plan, the_robot: Robot) -> None:
    """Write a plan, and state how many measurements it has."""
    keep_plan(output, designed, the_robot)
    give(plan=str(output), measurements=len(designed.measurements))
    say(f"{len(designed.measurements)} measurements in {output}")


def keep_plan(output: Path, designed: Plan, the_robot: Robot) -> None:
    """Write a plan, which remembers where its robot file lies."""
    source = Path(the_robot.source)
    if source.parent != ROBOTS:
        file = Path(os.path.relpath(source.resolve(), output.resolve().parent)).as_posix()
        remembered = designed.robot.model_copy(update={"file": file})
        designed = designed.model_copy(update={"robot": remembered})
    write_file(output, dump_plan(designed).encode())
