"""Before anything moves: a plan, chosen for a robot's base parameters, and its dry run."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import (
    BitRate,
    NoiseFrom,
    PlanFile,
    PlanWorkspace,
    RobotOption,
    RobotsDrives,
    WorkspaceOption,
)
from hil.cli.outputs import NewPlan, show
from hil.planning import LONGEST
from hil.terminal.console import out, say, working

if TYPE_CHECKING:
    from collections.abc import Sequence

commands = typer.Typer()

Count = partial(typer.Option, min=1, max=2000)
"""Option of a number of measurements; choosing among more takes longer than measuring them."""


@commands.command("dry-run")
def dry_run_(
    plan_file: PlanFile,
    robot_file: RobotOption = None,
    bitrate: Annotated[
        int | None,
        BitRate(help="Bit rate of the bus \\[bit/s]; by default that of the drives file."),
    ] = None,
    workspace: WorkspaceOption = None,
    noise_from: NoiseFrom = None,
    drives_file: RobotsDrives = None,
    view: Annotated[
        bool,
        typer.Option("--view", help="Write a page beside the plan that plays it in 3-D as well."),
    ] = False,
) -> None:
    """State what a plan takes and what it gives; nothing moves."""
    from hil.cli import plan_view
    from hil.cli.plan_files import load, refuse_problems
    from hil.cli.robot_drives import bus_cycle, following_of, known_drives
    from hil.planning.dry_run import dry_run

    if view:
        from hil.cli import viewing

        viewing.refuse_page(page := viewing.page_of_plan(plan_file))
    with working("reading the plan") as now:
        the_plan, the_robot = load(plan_file, robot_file, workspace)
        drives = known_drives(the_robot, drives_file)
        now("passing the plan's motions through the limits")
        cycle = bus_cycle(the_plan, the_robot.n_joints, drives, bitrate)
        following = following_of(drives, the_plan.sample_period)
        result = dry_run(the_plan, the_robot, cycle, following)
    plan_view.render(result, out)
    if view:
        viewing.write(page, viewing.scene_of_plan(the_plan, the_robot))
    refuse_problems(result, plan_file)
    if result.groups:
        from hil.cli.robot_drives import expected_of
        from hil.estimation.excluded.foreseen import foreseen
        from hil.friction.ripple import ripple_left_out
        from hil.planning.prediction.precision import predict
        from hil.results.tables import excluded

        with working("predicting the precision") as now:
            expected = expected_of(the_robot, noise_from, drives_file)
            noise, measurements = expected.noise, the_plan.measurements
            found = predict(the_robot, measurements, the_plan.sample_period, noise)
            now("predicting what it will exclude")
            proof = foreseen(the_plan, the_robot, noise, expected.p)
        plan_view.render_precision(found, the_robot, out)
        if proof is not None:
            show(
                excluded.foreseen(proof, the_robot.n_joints, expected.source),
                *excluded.sentences(proof),
            )
        if ripple := ripple_left_out(the_robot):
            say(ripple, style="yellow")


@commands.command()
def plan(
    output: NewPlan,
    name: Annotated[
        str | None,
        typer.Argument(help="Name of a robot that comes along, or path of a robot file."),
    ] = None,
    gravity: Annotated[
        int | None,
        Count(help="Number of gravity measurements.", show_default="56"),
    ] = None,
    inertia: Annotated[
        int | None,
        Count(help="Number of inertia measurements.", show_default="80"),
    ] = None,
    coupling: Annotated[
        int | None,
        Count(help="Number of coupling measurements.", show_default="16"),
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=LONGEST / 60,
            help="Duration, travel included, for which the most informative measurements are"
            " chosen \\[min].",
        ),
    ] = None,
    with_trajectories: Annotated[
        bool,
        typer.Option(
            "--with-trajectories",
            help="With --minutes: choose among trajectories too, for drives that follow streams of"
            " set-points.",
        ),
    ] = False,
    distinguish: Annotated[
        str | None,
        typer.Option(
            metavar="CAUSE\\[,CAUSE...]",
            help="Causes that the plan is to show in their usual size and to distinguish,"
            " such as 'load,zero of axis 4'; what it adds lasts as long as the plan at most.",
        ),
    ] = None,
    run: Annotated[
        list[Path] | None,
        typer.Option(
            "--refine",
            help="Run whose least precise parameters the plan measures again; may be repeated.",
        ),
    ] = None,
    noise_from: NoiseFrom = None,
    warm_up: Annotated[
        float,
        typer.Option(min=0, max=LONGEST, help="Duration of motion before measuring \\[s]."),
    ] = 0.0,
    workspace: PlanWorkspace = None,
) -> None:
    """Choose configurations and motions from g(q) and M(q)."""
    asked = {"gravity": gravity, "inertia": inertia, "coupling": coupling}
    counts = {kind: number for kind, number in asked.items() if number is not None}
    own = warm_up or workspace is not None or noise_from is not None
    for wrong, why in (
        ((name is None) == (not run), "give a robot, or a run with --refine: one of the two"),
        (
            counts and (minutes is not None or run),
            "--gravity, --inertia and --coupling are for a plan by counts; leave them out with"
            " --minutes and --refine, which choose them",
        ),
        (
            run and own,
            "--refine takes workspace and noise from the run; leave --warm-up, --workspace and"
            " --noise-from out",
        ),
        (
            with_trajectories and run,
            "--with-trajectories does not go with --refine, which chooses among strokes",
        ),
        (
            with_trajectories and minutes is None,
            "--with-trajectories needs --minutes, within which all kinds are weighed against each"
            " other; for trajectories alone there is hil trajectory plan",
        ),
        (
            distinguish is not None and (run or minutes is not None),
            "--distinguish adds to a plan by counts, as much as causes need; leave --minutes and"
            " --refine out",
        ),
        (
            noise_from is not None and minutes is None and distinguish is None,
            "--noise-from is for --minutes and --distinguish; a plan by counts uses no noise",
        ),
    ):
        if wrong:
            raise typer.BadParameter(why)
    if run:
        _refine(run, minutes or 10.0, output)
        return
    with working("reading the robot") as now:
        from checked_files.yaml_file import FileError
        from hil.cli.plan_files import load_guard, write_plan
        from hil.model.robot import load_robot, refuse_unknown
        from hil.planning.design.by_counts import design

        the_robot = load_robot(str(name))
        refuse_unknown(the_robot)
        if distinguish is not None:
            from hil.estimation.excluded.distinguishing import causes_named

            named = causes_named(the_robot, distinguish)
        try:
            guard = load_guard(workspace, the_robot)
            if minutes is None:
                now("choosing measurements")
                designed = design(the_robot, counts, warm_up, guard)
            else:
                from hil.cli.robot_drives import expected_of
                from hil.planning.design.by_minutes import design_within

                now(f"choosing the most informative measurements of {minutes:g} minutes")
                designed = design_within(
                    the_robot, minutes, expected_of(the_robot, noise_from).noise, warm_up, guard,
                    with_trajectories=with_trajectories,
                )  # fmt: skip
            if distinguish is not None:
                from hil.cli.robot_drives import expected_of
                from hil.estimation.excluded import distinguishing
                from hil.results.tables import excluded

                now("choosing measurements that distinguish causes")
                expected = expected_of(the_robot, noise_from)
                reached = distinguishing.distinguish(
                    designed, the_robot, expected.noise, expected.p, named
                )
                designed = reached.plan
        except ValueError as error:
            raise FileError(f"{name}: {error}") from error
    write_plan(output, designed, the_robot)
    if distinguish is not None:
        show(excluded.distinguished(reached, expected.source), *excluded.distinguishing(reached))


def _refine(runs: Sequence[Path], minutes: float, output: Path) -> None:
    with working("finding what the runs have shown") as now:
        from checked_files.yaml_file import FileError
        from hil.cli.plan_files import write_plan
        from hil.cli.plan_view import render_refinement
        from hil.cli.robot_drives import experience_of
        from hil.planning.design.by_minutes import refine
        from hil.planning.prediction.precision import information, precision

        folders, (noise, known, _) = experience_of(runs)
        first, robot = folders[0], folders[0].robot
        taken = {measurement.id for folder in folders for measurement in folder.motions}
        now(f"choosing the most informative measurements of {minutes:g} minutes")
        try:
            designed = refine(robot, minutes, noise, known, first.planned, taken)
        except ValueError as error:
            raise FileError(f"{first.path}: {error}") from error
        more = information(robot, designed.measurements, designed.sample_period, noise)
        before, then = (precision(robot, each, noise.source) for each in (known, known + more))
    write_plan(output, designed, robot)
    render_refinement(before, then, robot, out)
