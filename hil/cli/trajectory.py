"""Conventional identification: exciting trajectories.

`hil run` measures such a plan as any other, in cyclic synchronous position mode of the drives, and
`hil identify` estimates from it period by period.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from hil.cli.arguments import RobotName, RobotsDrives
from hil.cli.outputs import NewPlan
from hil.terminal.console import say, working

trajectory = typer.Typer(
    help="Conventional identification with periodic trajectories.", no_args_is_help=True
)
commands = typer.Typer()
commands.add_typer(trajectory, name="trajectory")


class Criterion(StrEnum):
    """What an exciting trajectory makes small."""

    CONDITION = "condition"
    SINGULAR = "singular"
    DET = "det"


@trajectory.command()
def plan(
    name: RobotName,
    output: NewPlan,
    minutes: Annotated[
        float, typer.Option(min=0.1, help="Duration of all periods together \\[min].")
    ] = 5.0,
    period: Annotated[
        float | None,
        typer.Option(
            min=1.0,
            help="Period of the trajectory \\[s]; better no multiple of the SYNC period.",
            show_default="10.0023",
        ),
    ] = None,
    criterion: Annotated[
        Criterion,
        typer.Option(
            help="Criterion of the optimum: condition number, smallest singular value or log det,"
            " of the observation matrix with scaled rows and columns."
        ),
    ] = Criterion.DET,
    harmonics: Annotated[
        int | None,
        typer.Option(
            min=2, max=50, help="Number of harmonics of each joint's motion.", show_default="15"
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(help="Seed of the search; the same seed gives the same trajectory.")
    ] = 0,
    warm_up: Annotated[
        float, typer.Option(min=0, help="Duration of motion before measuring \\[s].")
    ] = 0.0,
    drives_file: RobotsDrives = None,
) -> None:
    """Optimise a trajectory within the limits."""
    from hil.cli.plan_files import keep_plan
    from hil.cli.robot_drives import following_of, known_drives
    from hil.model.robot import load_robot, refuse_unknown
    from hil.planning.design.trajectories import HARMONICS, PERIOD, condition, design_trajectory
    from hil.planning.plan import Plan, PlannedRobot, WarmUp

    robot = load_robot(name)
    refuse_unknown(robot)
    period, harmonics = period or PERIOD, harmonics or HARMONICS
    cycles = max(1, round(60 * minutes / period))
    following = following_of(known_drives(robot, drives_file))
    with working(f"optimising a trajectory of {robot.n_joints} axes and {harmonics} harmonics"):
        found = design_trajectory(
            robot,
            period,
            cycles,
            criterion.value,
            seed,
            harmonics=harmonics,
            speed=following.speed if following else None,
        )
    designed = Plan(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        warm_up=WarmUp(duration=warm_up) if warm_up else None,
        measurements=(found,),
    )
    keep_plan(output, designed, robot)
    say(
        f"{cycles} periods of {period:g} s in {output}, condition number"
        f" {condition(robot, found):.3g}"
    )
