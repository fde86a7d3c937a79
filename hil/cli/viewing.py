"""Commands `hil view` and `hil replay`: a page in three dimensions, recordings simulated anew."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from hil.cli.arguments import (
    ModelPath,
    RobotOption,
    RunPath,
    Without,
    WorkspaceOption,
    robots,
    runs,
)
from hil.cli.outputs import (
    Status,
    file_to_write,
    output_option,
    refuse_no_folder,
    refuse_unwritable,
    show,
    write_page,
)
from hil.terminal.console import give, say, working

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.view.scene import Scene


commands = typer.Typer()

RUN_PAGE = "view.html"
"""Name of the page in a run's folder."""


@commands.command()
def view(
    what: Annotated[
        str,
        Argument(
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
        Option(
            "--model",
            help="Model for predicted torques: model file, or identified run.",
            autocompletion=runs,
        ),
    ] = None,
    urdf: Annotated[
        Path | None, Option("--urdf", help="URDF of the robot, for its visual meshes.")
    ] = None,
    meshes: Annotated[
        Path | None,
        Option("--meshes", help="Folder of meshes outside of the URDF's folder or package."),
    ] = None,
    robot_file: RobotOption = None,
    workspace: WorkspaceOption = None,
) -> None:
    """Write a 3-D page of a plan, a run or a robot; one HTML file."""
    path = Path(what)
    is_run, is_plan = path.is_dir(), path.suffix in {".yaml", ".yml"} and path.is_file()
    if is_plan:
        from checked_files.yaml_file import read_text

        is_plan = any(line.startswith("measurements:") for line in read_text(path).splitlines())
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
        from hil.cli.plan_view import load, load_guard
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
        if urdf is not None:
            from hil.view.visuals import visuals

            drawn = visuals(urdf, robot, meshes)
            for each in drawn.left_out:
                say(each, style="yellow")
            make = partial(make, visuals=drawn.visuals)
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


def _refuse(given: object, option: str, what: str) -> None:
    if given is not None:
        raise typer.BadParameter(f"{option} does not apply to {what}; omit the option")


Gains = Annotated[
    list[float] | None,
    Option(min=0.0, help="Gain of a PD controller; one for all axes, or one per axis."),
]


@commands.command()
def replay(
    folder: RunPath,
    model_path: ModelPath,
    simulator: Annotated[
        Literal["builtin", "mujoco"],
        Option(help="Built-in simulator with exact stick-slip, or MuJoCo (a separate package)."),
    ] = "builtin",
    friction: Annotated[
        Literal["law", "plain", "exported"] | None,
        Option(
            help="Friction: the model's law (law), only its offset, Coulomb and viscous terms"
            " (plain), or as exported (exported; always with mujoco)."
        ),
    ] = None,
    max_error: Annotated[
        list[str] | None,
        Option(
            metavar="LIMIT",
            help="Largest position error allowed, such as 2deg or 5mm; may be repeated.",
        ),
    ] = None,
    restart: Annotated[
        float | None,
        Option(min=0.05, help="Time after which a simulation restarts from the recording \\[s]."),
    ] = None,
    kp: Gains = None,
    kd: Gains = None,
    before: Annotated[
        Path | None,
        Option(help="URDF or MJCF of the robot: its own values are simulated as well."),
    ] = None,
    without: Without = None,
) -> None:
    """Simulate the recordings of a run with a model, and compute the position error.

    Drives repeat the recorded torques; with --kp and --kd they hold the recorded positions.
    Exit status 3 where an error passes its limit.
    """
    with working("reading the model") as now:
        import numpy as np

        from hil.commands import replay as command
        from hil.results.model import loaded
        from hil.runs.run import Run
        from hil.simulation import replay as simulated

        refuse_unwritable(folder / command.PAGE)
        limits = simulated.limits(max_error or ())
        run = Run.open(folder).exclude(without or ())
        model = loaded(model_path, run.robot)
        controller = None
        if kp or kd:
            gains = []
            for name, given in (("kp", kp), ("kd", kd)):
                if not given or len(given) not in (1, run.robot.n_joints):
                    raise typer.BadParameter(
                        f"{len(given or ())} values; a controller needs --kp and --kd, once or "
                        f"{run.robot.n_joints} times each",
                        param_hint=f"--{name}",
                    )
                gains.append(np.broadcast_to(np.array(given), run.robot.n_joints).copy())
            controller = simulated.Controller(*gains)
        models = [model]
        if before is not None:
            from hil.export.patch import patched_file, stated_model

            models.append(stated_model(model, patched_file(before, run.robot)))
        found, *others = (
            simulated.replay(
                run,
                each,
                simulator=simulator,
                friction=friction,
                controller=controller,
                restart=restart,
                progress=lambda name: now(f"simulating {name}"),
            )
            for each in models
        )
        outcome = command.replay(run, found, limits, *others)
    show(outcome)
    give(rms=found.rms.tolist(), largest=found.largest.tolist())
    if others:
        give(before=others[0].rms.tolist())
    write_page(folder / command.PAGE, outcome)
    if any(each.kind == "failed" for each in outcome.verdicts):
        raise typer.Exit(Status.REFUSED)
