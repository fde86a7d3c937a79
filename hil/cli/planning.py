"""Commands `hil plan` and `hil dry-run`."""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from hil.cli.arguments import (
    BitRate,
    NoiseFrom,
    PlanFile,
    PlanWorkspace,
    RobotOption,
    RobotsDrives,
    WorkspaceOption,
    robots,
    runs,
)
from hil.cli.outputs import NewPlan, page_option, show
from hil.planning import LONGEST
from hil.terminal.console import say, working

if TYPE_CHECKING:
    from hil.model.robot import Robot

commands = typer.Typer()


@commands.command("dry-run")
def dry_run_(
    plan_file: PlanFile,
    robot_file: RobotOption = None,
    bitrate: Annotated[
        int | None,
        BitRate(help="Bit rate of the bus \\[bit/s]; that of the drives file by default."),
    ] = None,
    workspace: WorkspaceOption = None,
    noise_from: NoiseFrom = None,
    drives_file: RobotsDrives = None,
    page: Annotated[Path | None, page_option("Page of the plan in 3-D to write")] = None,
) -> None:
    """Check a plan and predict its duration and precision; nothing moves."""
    from hil.cli import plan_view, viewing
    from hil.cli.plan_files import load
    from hil.tasks.measuring import dry_run, refuse_problems

    if page is not None:
        viewing.refuse_page(page)
    with working("reading the plan") as now:
        the_plan, the_robot = load(plan_file, robot_file, workspace)
        now("checking the plan's motions against the limits")
        result = dry_run(the_plan, the_robot, drives=drives_file, bitrate=bitrate)
    plan_view.render(result, the_robot)
    if page is not None:
        from hil.view.scene import plan_scene

        viewing.write(page, partial(plan_scene, the_plan, the_robot))
    refuse_problems(result, plan_file)
    if result.groups:
        from hil.estimation.excluded.foreseen import foreseen
        from hil.friction.ripple import ripple_left_out
        from hil.planning.prediction.precision import predict
        from hil.results.tables import excluded
        from hil.tasks.robot_drives import expected_of

        with working("predicting the precision") as now:
            expected = expected_of(the_robot, noise_from, drives_file)
            noise, measurements = expected.noise, the_plan.measurements
            found = predict(the_robot, measurements, the_plan.sample_period, noise)
            now("predicting detectable causes of error")
            proof = foreseen(the_plan, the_robot, noise, expected.p)
        plan_view.render_precision(found, the_robot)
        if proof is not None:
            show(
                excluded.foreseen(proof, the_robot.n_joints, expected.source),
                *excluded.sentences(proof),
            )
        if ripple := ripple_left_out(the_robot):
            say(ripple, style="yellow")


Kind = Literal["strokes", "friction", "trajectory", "load"]
"""Subject of a plan."""
Experiment = Literal["sweep", "stops", "operation"]
"""Experiment on friction."""
Criterion = Literal["condition", "singular", "det"]
"""Optimality criterion of an exciting trajectory."""


_strokes, _friction, _trajectory, _load = (
    partial[Any](typer.Option, rich_help_panel=f"Options of --kind {kind}")
    for kind in ("strokes", "friction", "trajectory", "load")
)
_count = partial(_strokes, min=1, max=2000)
"""Option for a number of measurements; the bound limits the time for choosing."""


@commands.command()
def plan(
    output: NewPlan,
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="ROBOT",
            help="Built-in robot or robot file; taken from the run with --refine and --kind load.",
            autocompletion=robots,
        ),
    ] = None,
    kind: Annotated[
        Kind,
        typer.Option(
            help="Measurements to plan: strokes for base parameters, sweeps for friction, a"
            " periodic trajectory, or slow strokes to estimate a load."
        ),
    ] = "strokes",
    minutes: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=LONGEST / 60,
            help="Duration of motion \\[min]; default 5 for a trajectory, 3 for a load; if "
            "omitted, strokes are chosen by number.",
        ),
    ] = None,
    warm_up: Annotated[
        float, typer.Option(min=0, max=LONGEST, help="Duration of motion before measuring \\[s].")
    ] = 0.0,
    workspace: PlanWorkspace = None,
    refine: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RUN",
            help="Run to refine: more measurements of its least precise parameters, or faster "
            "strokes of a load; may be repeated.",
            autocompletion=runs,
        ),
    ] = None,
    gravity: Annotated[
        int | None, _count(help="Number of gravity measurements.", show_default="56")
    ] = None,
    inertia: Annotated[
        int | None, _count(help="Number of inertia measurements.", show_default="80")
    ] = None,
    coupling: Annotated[
        int | None, _count(help="Number of coupling measurements.", show_default="16")
    ] = None,
    with_trajectories: Annotated[
        bool,
        _strokes(
            "--with-trajectories",
            help="With --minutes: choose among trajectories too, for drives that follow streams of"
            " set-points.",
        ),
    ] = False,
    distinguish: Annotated[
        str | None,
        _strokes(
            metavar="CAUSE[,CAUSE...]",
            help="Causes of error to be distinguished by the plan at their usual size, such as "
            "'load,joint offset of axis 4'; at most doubles the duration.",
        ),
    ] = None,
    noise_from: Annotated[
        Path | None,
        _strokes(
            help="Run for the estimate of noise; by default the noise of the robot file.",
            autocompletion=runs,
        ),
    ] = None,
    experiment: Annotated[
        Experiment | None,
        _friction(
            help="Experiment: all speeds once (sweep), motion with stops (stops), or all speeds "
            "after several durations of operation (operation).",
            show_default="sweep",
        ),
    ] = None,
    axis: Annotated[
        list[int] | None,
        _friction(
            metavar="NUMBER",
            help="Number of an axis from 1; a sweep accepts several, by default all axes.",
        ),
    ] = None,
    period: Annotated[
        float | None,
        _trajectory(
            min=1.0,
            help="Period of the trajectory \\[s]; preferably no multiple of the SYNC period.",
            show_default="10.0023",
        ),
    ] = None,
    criterion: Annotated[
        Criterion | None,
        _trajectory(
            help="Criterion of the optimum: condition number, smallest singular value or log det,"
            " of the observation matrix with scaled rows and columns.",
            show_default="det",
        ),
    ] = None,
    harmonics: Annotated[
        int | None,
        _trajectory(
            min=2, max=50, help="Number of harmonics of each joint's motion.", show_default="15"
        ),
    ] = None,
    seed: Annotated[
        int | None,
        _trajectory(
            help="Seed of the search; the same seed gives the same trajectory.", show_default="0"
        ),
    ] = None,
    drives: Annotated[
        Path | None, _trajectory(help="Drives file; the built-in one of the robot by default.")
    ] = None,
    model: Annotated[
        Path | None, _load(help="Identified run without the load.", autocompletion=runs)
    ] = None,
    at_most: Annotated[
        float | None, _load(min=1e-3, help="Maximum payload mass, to be held in all poses \\[kg].")
    ] = None,
    pose: Annotated[
        list[str] | None,
        _load(
            metavar="AXIS=VALUE",
            help="Axis and its position in all measurements, such as axis5=90 \\[deg; m]; may be"
            " repeated.",
        ),
    ] = None,
) -> None:
    """Plan measurements: strokes, friction sweeps, an exciting trajectory, or a load."""
    given = locals()
    from checked_files.yaml_file import FileError
    from hil.tasks.plans import Unsuited, designed

    options = {key: given[key] for key in given if key not in {"name", "output", "kind"}}
    source = name or next(iter(refine or ()), None)
    with working("reading the robot") as now:
        from hil.cli.plan_files import load_guard, write_plan
        from hil.model.robot import Robot, refuse_unknown
        from hil.runs.run import Run

        the_robot = None if name is None else Robot.load(name)
        if the_robot is not None:
            refuse_unknown(the_robot)
            if workspace is not None:
                options["workspace"] = load_guard(workspace, the_robot)
        if model is not None and kind == "load":
            source = model if model.is_dir() else model.parent
            options["model"] = Run.open(source)
            options["pose"] = poses(options["model"].robot, pose or [])
        try:
            found = designed(kind, now, robot=the_robot, **options)
        except Unsuited as error:
            raise typer.BadParameter(error.text) from error
        except ValueError as error:
            raise FileError(f"{source}: {error}") from error
    write_plan(output, found.plan, found.robot)
    show(*found.shown)
    if found.refinement:
        from hil.cli.plan_view import render_refinement

        render_refinement(*found.refinement, found.robot)


def poses(robot: Robot, stated: list[str]) -> tuple[tuple[int, float], ...]:
    """Parse axes from 0 and held positions [rad or m]."""
    found = []
    for each in stated:
        fits = re.fullmatch(r"axis(\d+)=([-+]?\d+(?:\.\d*)?)", each)
        if fits is None or not 1 <= int(fits[1]) <= robot.n_joints:
            raise typer.BadParameter(
                f"{each!r} must be axis1 to axis{robot.n_joints} and a position, such as axis5=90",
                param_hint="--pose",
            )
        axis, at = int(fits[1]) - 1, float(fits[2])
        found.append((axis, math.radians(at) if robot.revolute[axis] else at))
    return tuple(found)
