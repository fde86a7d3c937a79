"""Commands `hil robot`, `hil twin`, `hil plan` and `hil dry-run`: what precedes a measurement."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer import Argument, Option

from checked_files.errors import HilError
from hil.cli.arguments import (
    BitRate,
    NoiseFrom,
    PlanFile,
    PlanWorkspace,
    RobotName,
    RobotOption,
    RobotsDrives,
    WorkspaceOption,
    group_of,
    robots,
    runs,
)
from hil.cli.outputs import NewPlan, folder_to_write, new_file, output_option, page_option, show
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
    from hil.cli.plan_view import load
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
        from hil.planning.prediction.information import predict
        from hil.results.tables import excluded
        from hil.tasks.measuring import expected_of

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
    partial[Any](Option, rich_help_panel=f"Options of --kind {kind}")
    for kind in ("strokes", "friction", "trajectory", "load")
)
_count = partial(_strokes, min=1, max=2000)
"""Option for a number of measurements; the bound limits the time for choosing."""


@commands.command()
def plan(
    output: NewPlan,
    name: Annotated[
        str | None,
        Argument(
            metavar="ROBOT",
            help="Built-in robot or robot file; taken from the run with --refine and --kind load.",
            autocompletion=robots,
        ),
    ] = None,
    kind: Annotated[
        Kind,
        Option(
            help="Measurements to plan: strokes for base parameters, sweeps for friction, a"
            " periodic trajectory, or slow strokes to estimate a load."
        ),
    ] = "strokes",
    minutes: Annotated[
        float | None,
        Option(
            min=0.1,
            max=LONGEST / 60,
            help="Duration of motion \\[min]; default 5 for a trajectory, 3 for a load; if "
            "omitted, strokes are chosen by number.",
        ),
    ] = None,
    warm_up: Annotated[
        float, Option(min=0, max=LONGEST, help="Duration of motion before measuring \\[s].")
    ] = 0.0,
    workspace: PlanWorkspace = None,
    refine: Annotated[
        list[Path] | None,
        Option(
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
        from hil.cli.plan_view import load_guard, write_plan
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


robot_commands = typer.Typer(
    cls=group_of("show"),
    help="Show what can be identified of a robot, or write a first robot file.",
    no_args_is_help=True,
)
commands.add_typer(robot_commands, name="robot")


@robot_commands.command("show")
def show_robot(name: RobotName) -> None:
    """Show base parameters and where they occur in M and g; the default command."""
    with working("reading the robot") as now:
        from hil.cli import plan_view
        from hil.model.base_parameters import base_parameters
        from hil.model.robot import Robot

        robot = Robot.load(name)
        now(f"finding the base parameters of {robot.n_joints} joints")
        base_parameters(robot)
    plan_view.render_robot(robot)


@robot_commands.command()
def new(
    output: Annotated[Path, output_option(new_file, "Robot file to write.")],
    urdf: Annotated[
        Path | None, Option("--urdf", help="URDF or MJCF; expand a xacro file first.")
    ] = None,
    dh: Annotated[
        Path | None,
        Option("--dh", help="Table of standard Denavit-Hartenberg parameters; CSV or YAML."),
    ] = None,
    mdh: Annotated[
        Path | None,
        Option("--mdh", help="Table of modified Denavit-Hartenberg parameters; CSV or YAML."),
    ] = None,
    base: Annotated[str | None, Option("--from", help="Base link; the root by default.")] = None,
    tip: Annotated[
        str | None,
        Option(
            "--to",
            help="Last link, or several separated by commas; by default that of the"
            " longest chain, or all of a tree.",
        ),
    ] = None,
    gravity: Annotated[
        tuple[float, float, float] | None,
        Option(
            metavar="X Y Z",
            help="Gravity in the base link, or frame 0 \\[m/s2].",
            show_default="9.81 along -z of the URDF's root, or of frame 0",
        ),
    ] = None,
) -> None:
    """Write a first robot file from a URDF, an MJCF or a table, and list what to fill in."""
    from checked_files.yaml_file import UNSTATED
    from hil.model.readers.robot_draft import draft_robot
    from hil.runs.atomic_file import write_file

    if sum(given is not None for given in (urdf, dh, mdh)) != 1:
        raise typer.BadParameter("give one of --urdf, --dh and --mdh")
    if urdf is None and (base or tip):
        raise typer.BadParameter("--from and --to apply only to a URDF; omit both")
    if urdf is not None:
        from hil.model.robot import read_description

        chain = read_description(urdf, base, tip)
        joints = ", ".join(joint.name for joint in chain.joints)
        about = f"{len(chain.joints)} joints from {chain.base} to {chain.tip}: {joints}"
        found, rounded = "\n".join([about, *chain.not_taken]), chain.rounded
        text = draft_robot(chain, gravity)
    else:
        from hil.model.readers.dh_table import read_dh

        dh_table = read_dh(dh, "standard") if dh is not None else read_dh(str(mdh), "modified")
        types = ", ".join(f"{joint.name} {joint.type}" for joint in dh_table.joints)
        found = f"{len(dh_table.joints)} joints of a {dh_table.notation} table: {types}"
        text, rounded = draft_robot(dh_table, gravity), dh_table.rounded
    write_file(output, text.encode())
    say(found)
    if rounded > 0:
        say(f"angles within {rounded:.2g} rad of a multiple of pi/2 were rounded to that multiple")
    marks = text.count(f": {UNSTATED} ")
    say(f"{output}: {marks} lines marked {UNSTATED} must be filled in by you")


@commands.command()
def twin(
    name: RobotName,
    output: Annotated[Path, output_option(folder_to_write, "Folder to write both files into.")],
) -> None:
    """Write a virtual plant of a robot and a drives file, for rehearsals."""
    # the plant runs as a separate program: its arm model must stay independent of the tested model
    with working("scaling a plant to the limits of the robot"):
        from hil.model.robot import Robot

        robot = Robot.load(name).source
        made = subprocess.run(  # noqa: S603 - our own program, by its own name
            [sys.executable, "-m", "sim_plant", "twin", robot, "--output", str(output)],
            capture_output=True,
            text=True,
            check=False,
        )
    if made.returncode:
        raise HilError(made.stderr.strip().removeprefix("sim_plant: "))
    say(made.stdout.rstrip())
