"""Command `hil view`: a page with a plan, a run or a robot in three dimensions."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import RobotOption, WorkspaceOption, robots, runs
from hil.cli.outputs import file_to_write, output_option, refuse_no_folder, refuse_unwritable
from hil.terminal.console import say, working

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.model.robot import Robot
    from hil.view.scene import Scene
    from hil.view.visuals import Visual

commands = typer.Typer()

RUN_PAGE = "view.html"
"""Name of the page in a run's folder."""


@commands.command()
def view(
    what: Annotated[
        str,
        typer.Argument(
            metavar="PLAN|RUN|ROBOT",
            help="Plan, run folder, or robot: built-in, robot file or URDF.",
            autocompletion=robots,
        ),
    ],
    output: Annotated[
        Path | None,
        output_option(
            file_to_write,
            "Page to write; by default next to the plan, in the run folder, or in the current "
            "folder.",
        ),
    ] = None,
    model_path: Annotated[
        Path | None,
        typer.Option(
            "--model",
            help="Model for predicted torques: model file, or identified run.",
            autocompletion=runs,
        ),
    ] = None,
    urdf: Annotated[
        Path | None, typer.Option("--urdf", help="URDF of the robot, for its visual meshes.")
    ] = None,
    meshes: Annotated[
        Path | None,
        typer.Option("--meshes", help="Folder of meshes outside of the URDF's folder or package."),
    ] = None,
    robot_file: RobotOption = None,
    workspace: WorkspaceOption = None,
) -> None:
    """Write a 3-D page of a plan, a run or a robot; one HTML file."""
    path = Path(what)
    is_run, is_plan = path.is_dir(), _is_plan(path)
    if is_run:
        _refuse(robot_file, "--robot", "a run, which has its own robot file")
        _refuse(workspace, "--workspace", "a run, which has its own workspace")
    elif not is_plan:
        _refuse(robot_file, "--robot", "a robot")
        _refuse(model_path, "--model", "a robot without motion")
    beside = path.with_suffix(".html") if is_plan else Path(f"{path.stem}.html")
    page = output or (path / RUN_PAGE if is_run else beside)
    refuse_page(page)
    with working(f"reading {what}"):
        from hil.cli.plan_files import load, load_guard
        from hil.model.robot import DESCRIPTIONS, Robot
        from hil.results.model import loaded
        from hil.results.model_file import NAME
        from hil.runs.run import Run
        from hil.view.scene import plan_scene, robot_scene, run_scene

        make: Callable[..., Scene]
        if is_run:
            run = Run.open(path)
            robot, make = run.robot, partial(run_scene, run)
            if model_path is None and (path / NAME).exists():
                model_path = path / NAME
        elif is_plan:
            plan, robot = load(path, robot_file, workspace)
            make = partial(plan_scene, plan, robot)
        else:
            robot = Robot.load(what)
            make = partial(robot_scene, robot, load_guard(workspace, robot))
            if urdf is None and what.lower().endswith(DESCRIPTIONS):
                urdf = path
        if model_path is not None:
            make = partial(make, model=loaded(model_path, robot))
        make = partial(make, visuals=_visuals(urdf, robot, meshes))
    write(page, make)


def refuse_page(path: Path) -> None:
    """Refuse an unwritable path, or another kind of file."""
    from hil.view.page import refuse_other_file

    refuse_no_folder(path)
    refuse_unwritable(path)
    refuse_other_file(path)


def write(path: Path, make: Callable[[int], Scene]) -> None:
    """Write a page, and state the path."""
    with working("making the page"):
        from hil.view.page import write_page

        size = write_page(path, make)
    say(f"page in {path} ({size / 1e6:.1f} MB)")


def _visuals(urdf: Path | None, robot: Robot, meshes: Path | None) -> Sequence[Visual]:
    """Load the visual meshes of a URDF; state omissions."""
    if urdf is None:
        return ()
    from hil.view.visuals import visuals

    found = visuals(urdf, robot, meshes)
    for each in found.left_out:
        say(each, style="yellow")
    return found.visuals


def _is_plan(path: Path) -> bool:
    """Return True if the file is a plan."""
    if path.suffix not in {".yaml", ".yml"} or not path.is_file():
        return False
    from checked_files.yaml_file import read_text

    return any(line.startswith("measurements:") for line in read_text(path).splitlines())


def _refuse(given: object, option: str, what: str) -> None:
    if given is not None:
        raise typer.BadParameter(f"{option} does not apply to {what}; omit the option")
