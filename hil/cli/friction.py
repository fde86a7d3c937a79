"""`hil friction`: plan, run and fit measurements of friction, and of its variance in time."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from checked_files.yaml_file import FileError
from hil.cli.arguments import NewPlan, RobotName, RunPath, refuse_existing
from hil.cli.measuring import run
from hil.cli.run_session import show_remarks
from hil.model.robot import load_robot
from hil.planning.plan import dump_plan
from hil.planning.workspace import load_workspace
from hil.runs.atomic_file import write_file
from hil.terminal.console import out

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.planning.workspace import Workspace

friction = typer.Typer(help="Friction, and how it changes in time.", no_args_is_help=True)
friction.command()(run)
commands = typer.Typer()
commands.add_typer(friction, name="friction")


class Experiment(StrEnum):
    """What is measured."""

    SWEEP = "sweep"
    STOPS = "stops"
    OPERATION = "operation"


@friction.command()
def plan(
    name: RobotName,
    output: NewPlan,
    experiment: Annotated[
        Experiment,
        typer.Option(
            help="All speeds once; motion with stops; all speeds after times of operation."
        ),
    ] = Experiment.SWEEP,
    axis: Annotated[
        list[int] | None,
        typer.Option(help="Axis from 1; a sweep takes several, and all if none is given."),
    ] = None,
    workspace: Annotated[
        Path | None, typer.Option("--workspace", help="Joint ranges and forbidden boxes.")
    ] = None,
) -> None:
    """Plan constant-velocity sweeps, or an experiment on friction's variance in time."""
    robot = load_robot(name)
    refuse_existing(output)
    guard = None if workspace is None else load_workspace(workspace, robot)
    show_remarks(guard, robot, out)
    axes = [_index(number, robot) for number in axis or ()]
    try:
        planned = _planned(experiment, robot, axes, guard)
    except ValueError as error:
        raise FileError(f"{name}: {error}") from error
    write_file(output, dump_plan(planned).encode())
    out.print(f"{len(planned.measurements)} measurements in {output}", highlight=False)


@friction.command()
def fit(
    folder: RunPath,
    model: Annotated[
        Path | None,
        typer.Option(help="Folder of an identified run, to compensate gravity by its model."),
    ] = None,
    asymmetry: Annotated[
        float | None,
        typer.Option(min=0, help="Accepted asymmetry, as share of the friction level."),
    ] = None,
) -> None:
    """Fit friction models to a run, test symmetry; writes friction.yaml into its folder."""
    from hil.cli import friction_view  # noqa: PLC0415 - slow to import
    from hil.estimation.friction.symmetry import BOUND  # noqa: PLC0415 - slow to import
    from hil.results import friction_file  # noqa: PLC0415 - slow to import

    found = friction_file.fit(folder, model, BOUND if asymmetry is None else asymmetry)
    friction_view.render(found, out)
    out.print(f"friction in {folder / friction_file.NAME}", highlight=False, soft_wrap=True)


def _planned(
    experiment: Experiment, robot: Robot, axes: list[int], workspace: Workspace | None
) -> Plan:
    from hil.planning.design import friction  # noqa: PLC0415 - slow to import

    if experiment is Experiment.SWEEP:
        return friction.sweep(robot, axes, workspace=workspace)
    if len(axes) != 1:
        raise typer.BadParameter(f"{experiment.value} takes one axis", param_hint="--axis")
    if experiment is Experiment.STOPS:
        return friction.stops(robot, axes[0], workspace=workspace)
    return friction.operation(robot, axes[0], workspace=workspace)


def _index(number: int, robot: Robot) -> int:
    if not 1 <= number <= robot.n_joints:
        raise typer.BadParameter(f"{number} must be in 1 ... {robot.n_joints}", param_hint="--axis")
    return number - 1
