"""`hil friction`: plan, run and fit measurements of friction, and of its variance in time."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import PlanWorkspace, RobotName, RunPath
from hil.cli.measuring import run
from hil.cli.outputs import NewPlan, refuse_unwritable, say_simulated, show
from hil.terminal.console import out, say, working

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
            help="Experiment: all speeds once (sweep), motion with stops (stops), or all speeds"
            " after times of operation (operation)."
        ),
    ] = Experiment.SWEEP,
    axis: Annotated[
        list[int] | None,
        typer.Option(
            help="Number of an axis from 1; a sweep takes several, and all if none is given."
        ),
    ] = None,
    workspace: PlanWorkspace = None,
) -> None:
    """Plan constant-velocity sweeps, or an experiment on friction's variance in time."""
    from checked_files.yaml_file import FileError
    from hil.cli.plan_files import load_guard, write_plan
    from hil.model.robot import load_robot, refuse_unknown

    robot = load_robot(name)
    refuse_unknown(robot)
    guard = load_guard(workspace, robot)
    axes = [_index(number, robot) for number in axis or ()]
    try:
        planned = _planned(experiment, robot, axes, guard)
    except ValueError as error:
        raise FileError(f"{name}: {error}") from error
    write_plan(output, planned, robot)


@friction.command()
def fit(
    folder: RunPath,
    model: Annotated[
        Path | None,
        typer.Option(help="Folder of an identified run, whose model compensates gravity."),
    ] = None,
    asymmetry: Annotated[
        float | None,
        typer.Option(
            min=0, help="Greatest asymmetry that is accepted, as share of the friction level."
        ),
    ] = None,
) -> None:
    """Fit friction models to a run, test symmetry; writes friction.yaml into its folder."""
    with working("reading the run") as now:
        from hil.estimation.friction.symmetry import BOUND
        from hil.results.friction import evaluate
        from hil.results.friction_file import NAME, write_friction
        from hil.results.tables import friction as tables
        from hil.results.tables.terminal import show_remark
        from hil.runs.pooling import recorded
        from hil.runs.run import Run

        refuse_unwritable(folder / NAME)
        run = Run.open(folder)
        bound = BOUND if asymmetry is None else asymmetry
        now("fitting models of friction")
        found = evaluate(run, list(recorded(run)), model, bound)
    path = write_friction(run, found)
    say_simulated(run)
    show(tables.models(found), tables.symmetry(found.symmetry), tables.drift(found.drifts))
    for left in found.left_out:
        show_remark(f"left out: {left}", out)
    say(f"friction in {path}")


def _planned(
    experiment: Experiment, robot: Robot, axes: list[int], workspace: Workspace | None
) -> Plan:
    from hil.planning.design import friction

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
