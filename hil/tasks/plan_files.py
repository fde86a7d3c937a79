"""Plan with robot and workspace, as named in commands and Python."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.model.robot import Robot, refuse_unknown
from hil.planning.plan import Plan, load_plan, refuse_other_robot
from hil.planning.workspace_check import load_workspace

if TYPE_CHECKING:
    from hil.planning.workspace import Workspace


def opened_plan(
    plan: Plan | Path | str,
    robot: Robot | Path | str | None = None,
    workspace: Workspace | Path | str | None = None,
) -> tuple[Plan, Robot]:
    """Return a plan with the workspace, and the robot.

    Parameters
    ----------
    plan : Plan or path
    robot : Robot, path or str, optional
        Robot, by default the one named in the plan.
    workspace : Workspace or path, optional
        Workspace in place of the plan's own.

    Raises
    ------
    FileError
        One of the files cannot be used, or the plan is of another robot.
    """
    source = str(plan) if isinstance(plan, (str, Path)) else "plan"
    the_plan = plan if isinstance(plan, Plan) else load_plan(Path(plan))
    if not isinstance(robot, Robot):
        robot = Robot.load(robot or _robot_file(the_plan, Path(source)))
    refuse_unknown(robot)
    refuse_other_robot(the_plan, robot, source)
    if workspace is not None:
        if isinstance(workspace, (str, Path)):
            workspace = load_workspace(Path(workspace), robot)
        the_plan = the_plan.model_copy(update={"workspace": workspace})
    return the_plan, robot


def _robot_file(the_plan: Plan, source: Path) -> str | Path:
    """Return the name of the plan's robot, or the path of an existing robot file."""
    if the_plan.robot.file is None:
        return the_plan.robot.name
    path = source.parent / the_plan.robot.file
    if not path.exists():
        raise FileError(
            f"{source}: robot.file: {path} does not exist; name the robot file with --robot"
        )
    return path
