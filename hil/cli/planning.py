"""Before anything moves: a robot's base parameters, a plan chosen for them, a plan's dry run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from checked_files.yaml_file import FileError
from hil.cli import dry_run_view, robot_view
from hil.cli.arguments import NewPlan, RobotName, refuse_existing
from hil.cli.run_session import show_remarks, with_workspace
from hil.model.robot import ROBOTS, load_robot
from hil.planning.dry_run import BITRATE, dry_run
from hil.planning.plan import LONGEST, dump_plan, load_plan, refuse_other_robot
from hil.planning.workspace import load_workspace
from hil.runs.atomic_file import write_file
from hil.terminal.console import out

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hil.estimation.noise_levels import Levels
    from hil.model.robot import Robot
    from hil.planning.dry_run import DryRun
    from hil.planning.plan import Plan
    from hil.planning.prediction.noise import Noise
    from hil.runs.run_folder import RunFolder

commands = typer.Typer()

MOST = 2000
"""Measurements of a kind; choosing among more takes longer than measuring them."""
REFINEMENT = 10.0
"""Duration of a refinement unless another is asked for [min]."""

PlanFile = Annotated[Path, typer.Argument(help="Plan as YAML.")]
RobotOption = Annotated[
    str | None, typer.Option("--robot", help="Robot file, if the robot does not come along.")
]
WorkspaceOption = Annotated[
    Path | None,
    typer.Option("--workspace", help="Joint ranges and forbidden boxes; else those of the plan."),
]
NoiseFrom = Annotated[
    Path | None,
    typer.Option(help="Run that shows this robot's noise; else what the robot file states."),
]


@commands.command()
def robot(name: RobotName) -> None:
    """Show base parameters, their groups, and where they occur in M and g."""
    robot_view.render(load_robot(name), out)


@commands.command("dry-run")
def dry_run_(
    plan_file: PlanFile,
    robot_file: RobotOption = None,
    bitrate: Annotated[int, typer.Option(min=10_000, max=1_000_000, help="bit/s")] = BITRATE,
    workspace: WorkspaceOption = None,
    noise_from: NoiseFrom = None,
    drives_file: Annotated[
        Path | None, typer.Option("--drives", help="Drives file, for the torques' resolution.")
    ] = None,
) -> None:
    """State what a plan takes and what it gives; nothing moves."""
    the_plan, the_robot = load(plan_file, robot_file, workspace)
    result = dry_run(the_plan, the_robot, bitrate)
    dry_run_view.render(result, out)
    refuse_problems(result, plan_file)
    if result.groups:
        from hil.cli import precision_view  # noqa: PLC0415 - slow to import, used here only
        from hil.planning.prediction.precision import predict  # noqa: PLC0415 - slow to import, used here only

        noise = noise_of(the_robot, noise_from, drives_file)
        found = predict(the_robot, the_plan.measurements, the_plan.sample_period, noise)
        precision_view.render(found, the_robot, out)


@commands.command()
def plan(
    output: NewPlan,
    name: Annotated[str | None, typer.Argument(help="Name, or path of a robot file.")] = None,
    gravity: Annotated[
        int | None, typer.Option(min=1, max=MOST, help="Gravity measurements.", show_default="64")
    ] = None,
    inertia: Annotated[
        int | None, typer.Option(min=1, max=MOST, help="Inertia measurements.", show_default="92")
    ] = None,
    coupling: Annotated[
        int | None, typer.Option(min=1, max=MOST, help="Coupling measurements.", show_default="9")
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=LONGEST / 60,
            help="Choose the most informative measurements for this time, travel included.",
        ),
    ] = None,
    run: Annotated[
        list[Path] | None,
        typer.Option(
            "--refine", help="Run to go on from: measure what is imprecise; may be repeated."
        ),
    ] = None,
    noise_from: NoiseFrom = None,
    warm_up: Annotated[
        float, typer.Option(min=0, max=LONGEST, help="Motion beforehand \\[s].")
    ] = 0.0,
    workspace: Annotated[
        Path | None, typer.Option(help="Joint ranges and forbidden boxes to keep clear of.")
    ] = None,
) -> None:
    """Choose configurations and motions from g(q) and M(q)."""
    asked = {"gravity": gravity, "inertia": inertia, "coupling": coupling}
    counts = {kind: number for kind, number in asked.items() if number is not None}
    _refuse_contradictions(name, run, minutes, counts, warm_up, workspace, noise_from)
    refuse_existing(output)
    if run:
        _refine(run, minutes or REFINEMENT, output)
        return
    the_robot = load_robot(str(name))
    try:
        guard = None if workspace is None else load_workspace(workspace, the_robot)
        show_remarks(guard, the_robot, out)
        if minutes is None:
            from hil.planning.design.by_counts import COUNTS, design  # noqa: PLC0415 - slow to import

            designed = design(the_robot, COUNTS | counts, warm_up, guard)
        else:
            from hil.planning.design.by_minutes import design_within  # noqa: PLC0415 - slow to import

            noise = noise_of(the_robot, noise_from)
            designed = design_within(the_robot, minutes, noise, warm_up, guard)
    except ValueError as error:
        raise FileError(f"{name}: {error}") from error
    _write(output, designed)


def load(plan_file: Path, robot_file: str | None, workspace: Path | None) -> tuple[Plan, Robot]:
    """Read a plan, its robot and the workspace that holds for it; show what is strange about it.

    Raises
    ------
    FileError
        One of the files cannot be used, or the plan is of another robot.
    """
    the_plan = load_plan(plan_file)
    the_robot = load_robot(robot_file or the_plan.robot.name)
    refuse_other_robot(the_plan, the_robot, str(plan_file))
    the_plan = with_workspace(the_plan, the_robot, workspace)
    show_remarks(the_plan.workspace, the_robot, out)
    return the_plan, the_robot


def refuse_problems(result: DryRun, plan_file: Path) -> None:
    """Refuse a plan whose dry run has found problems.

    Raises
    ------
    FileError
        With the problems and their lines in the file.
    """
    if result.problems:
        text = plan_file.read_text(encoding="utf-8")
        raise FileError(dry_run_view.describe_problems(result, text, str(plan_file)))


def noise_of(robot: Robot, run: Path | None, drives_file: Path | None = None) -> Noise:
    """Noise that an earlier run shows, or else what robot file and drives file let expect.

    Raises
    ------
    FileError
        The run is of another robot.
    """
    from hil.planning.prediction.noise import stated_noise  # noqa: PLC0415 - slow to import, used here only

    if run is None:
        return stated_noise(robot, _resolution(robot, drives_file))
    folders, levels = _experience([run])
    if folders[0].robot.digest != robot.digest:
        raise FileError(
            f"{run}: was measured with another robot file of {folders[0].robot.name} than this plan"
            f" is for; leave --noise-from out, or name a run of {robot.name} as it is now"
        )
    return levels.noise


def _refine(runs: Sequence[Path], minutes: float, output: Path) -> None:
    from hil.cli import precision_view  # noqa: PLC0415 - slow to import, used here only
    from hil.planning.design.by_minutes import refine  # noqa: PLC0415 - slow to import, used here only
    from hil.planning.prediction.precision import information, precision  # noqa: PLC0415 - slow to import

    folders, (noise, known) = _experience(runs)
    first, robot = folders[0], folders[0].robot
    taken = {measurement.id for folder in folders for measurement in folder.plan.measurements}
    try:
        designed = refine(robot, minutes, noise, known, first.plan, taken)
    except ValueError as error:
        raise FileError(f"{first.path}: {error}") from error
    _write(output, designed)
    more = information(robot, designed.measurements, designed.sample_period, noise)
    now, then = (precision(robot, each, noise.source) for each in (known, known + more))
    precision_view.render_refinement(now, then, robot, out)


def _experience(runs: Sequence[Path]) -> tuple[list[RunFolder], Levels]:
    from hil.results.prior_knowledge import experience  # noqa: PLC0415 - slow to import, used here only
    from hil.runs.pooling import open_runs  # noqa: PLC0415 - slow to import, used here only

    folders = open_runs(runs)
    return folders, experience(folders)


def _write(output: Path, designed: Plan) -> None:
    write_file(output, dump_plan(designed).encode())
    out.print(f"{len(designed.measurements)} measurements in {output}", highlight=False)


def _resolution(robot: Robot, drives_file: Path | None) -> list[float] | None:
    """Smallest steps of the torques, if a drives file states them [N m]."""
    from drivers.axis import AxisScale  # noqa: PLC0415 - slow to import, used here only
    from drivers.drives_file import load_drives  # noqa: PLC0415 - slow to import, used here only

    path = drives_file or ROBOTS / f"{robot.name}.drives.yaml"
    if drives_file is None and not path.exists():
        return None
    axes = load_drives(path).axes
    if len(axes) != robot.n_joints:
        raise FileError(
            f"{path}: {len(axes)} axes must be {robot.n_joints}, one for each joint of {robot.name}"
        )
    return [abs(AxisScale.of(axis).torque) for axis in axes]


def _refuse_contradictions(
    name: str | None,
    run: list[Path] | None,
    minutes: float | None,
    counts: Mapping[str, int],
    warm_up: float,
    workspace: Path | None,
    noise_from: Path | None,
) -> None:
    """Refuse options that do not go together."""
    if (name is None) == (not run):
        raise typer.BadParameter("give a robot, or a run with --refine: one of the two")
    if counts and (minutes is not None or run):
        raise typer.BadParameter(
            "--gravity, --inertia and --coupling are for a plan by counts; leave them out with"
            " --minutes and --refine, which choose them"
        )
    if run and (warm_up or workspace is not None or noise_from is not None):
        raise typer.BadParameter(
            "--refine takes workspace and noise from the run; leave --warm-up, --workspace and"
            " --noise-from out"
        )
    if noise_from is not None and minutes is None:
        raise typer.BadParameter("--noise-from is for --minutes; a plan by counts uses no noise")
