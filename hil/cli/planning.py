"""Choosing measurements: by counts, within minutes, or as what an earlier run leaves to be told."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from drivers.yaml_file import FileError
from hil.measuring.atomic_file import write_file
from hil.model.robot import ROBOTS, load_robot
from hil.planning.plan import LONGEST, dump_plan
from hil.planning.workspace import load_workspace
from hil.terminal.run_command import show_remarks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.noise_levels import Levels
    from hil.measuring.run_folder import RunFolder
    from hil.model.robot import Robot
    from hil.planning.noise import Noise
    from hil.planning.plan import Plan

commands = typer.Typer()
out = Console()

MOST = 2000
"""Measurements of a kind; choosing among more takes longer than measuring them."""
REFINEMENT = 10.0
"""Duration of a refinement unless another is asked for [min]."""

NoiseFrom = Annotated[
    Path | None,
    typer.Option(help="Run that shows this robot's noise; else what the robot file states."),
]


@commands.command()
def plan(
    output: Annotated[Path, typer.Option("-o", "--output", help="Plan to write.")],
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
            min=0.1, max=LONGEST / 60, help="Choose what tells most in this time, travel included."
        ),
    ] = None,
    run: Annotated[
        list[Path] | None,
        typer.Option("--refine", help="Run to go on from: measure what is weak; may be repeated."),
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
    counts = (gravity, inertia, coupling)
    _refuse_contradictions(name, run, minutes, counts, warm_up, workspace, noise_from)
    if output.exists():
        raise FileError(f"{output}: is there already; remove it or choose another name with -o")
    if run:
        _refine(run, minutes or REFINEMENT, output)
        return
    the_robot = load_robot(str(name))
    try:
        guard = None if workspace is None else load_workspace(workspace, the_robot)
        show_remarks(guard, the_robot, out)
        if minutes is None:
            from hil.planning.experiment_design import COUNTS, design  # noqa: PLC0415 - slow to import

            asked = gravity or COUNTS[0], inertia or COUNTS[1], coupling or COUNTS[2]
            designed = design(the_robot, asked, warm_up, guard)
        else:
            from hil.planning.budget import design_within  # noqa: PLC0415 - slow to import

            noise = noise_of(the_robot, noise_from)
            designed = design_within(the_robot, minutes, noise, warm_up, guard)
    except ValueError as error:
        raise FileError(f"{name}: {error}") from error
    _write(output, designed)


def noise_of(robot: Robot, run: Path | None, drives_file: Path | None = None) -> Noise:
    """Noise that an earlier run shows, or else what robot file and drives file let expect.

    Raises
    ------
    FileError
        The run is of another robot.
    """
    from hil.planning.noise import stated_noise  # noqa: PLC0415 - slow to import, used here only

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
    from hil.planning.budget import refine  # noqa: PLC0415 - slow to import, used here only
    from hil.planning.precision import information, precision  # noqa: PLC0415 - slow to import
    from hil.terminal import precision_view  # noqa: PLC0415 - slow to import, used here only

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
    from hil.results.experience import experience  # noqa: PLC0415 - slow to import, used here only
    from hil.results.pooling import open_runs  # noqa: PLC0415 - slow to import, used here only

    folders = open_runs(runs)
    return folders, experience(folders)


def _write(output: Path, designed: Plan) -> None:
    write_file(output, dump_plan(designed).encode())
    out.print(f"{len(designed.measurements)} measurements in {output}", highlight=False)


def _resolution(robot: Robot, drives_file: Path | None) -> list[float] | None:
    """Smallest steps of the torques, if a drives file states them [N m]."""
    from drivers.drives_file import load_drives  # noqa: PLC0415 - slow to import, used here only
    from drivers.scaling import AxisScale  # noqa: PLC0415 - slow to import, used here only

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
    counts: Sequence[int | None],
    warm_up: float,
    workspace: Path | None,
    noise_from: Path | None,
) -> None:
    """Refuse options that do not go together."""
    counted = any(count is not None for count in counts)
    if (name is None) == (not run):
        raise typer.BadParameter("give a robot, or a run with --refine: one of the two")
    if counted and (minutes is not None or run):
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
