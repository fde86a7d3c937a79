"""`hil track`: how closely axes follow a trajectory with neither, velocity and both fed forward."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.arguments import (
    ModelPath,
    PlanFile,
    RealTime,
    RobotOption,
    RobotsBus,
    WorkspaceOption,
    expand_records,
)
from hil.cli.measuring import OnBus
from hil.cli.outputs import folder_to_write, output_option, say_simulated
from hil.terminal.console import out, say, working

commands = typer.Typer()


@commands.command()
@expand_records
def track(
    plan_file: PlanFile,
    model_path: ModelPath,
    output: Annotated[
        Path, output_option(folder_to_write, "Folder of the three runs and of what they show.")
    ],
    *,
    where: RobotsBus,
    resume: Annotated[
        bool, typer.Option("--resume", help="Measure the passes that are missing in the folder.")
    ] = False,
    delay: Annotated[
        float,
        typer.Option(
            min=0, max=10, help="Delay by which drives follow their set-points \\[SYNC periods]."
        ),
    ] = 1.5,
    loop: Annotated[
        float,
        typer.Option("--loop-period", min=0, max=0.1, help="Period of the drives' loops \\[s]."),
    ] = 0.001,
    robot_file: RobotOption = None,
    workspace: WorkspaceOption = None,
    realtime: RealTime = False,
) -> None:
    """Follow trajectories with neither, velocity and both fed forward; the robot moves."""
    from functools import partial

    with working("predicting the torques of the plan"):
        from checked_files.yaml_file import FileError
        from hil.cli.measuring import measure
        from hil.cli.plan_files import load
        from hil.cli.run_session import refuse_unusable
        from hil.measuring.feeding import FeedingBus, refuse_beyond_torque
        from hil.planning.trajectory import Trajectory
        from hil.results.model import Model
        from hil.results.model_file import file_of
        from hil.results.tracking import PASSES

        for name in PASSES:
            refuse_unusable(output / name, resume and (output / name).exists())
        the_plan, the_robot = load(plan_file, robot_file, workspace)
        model = Model.load(model_path)
        predict = model.drive_torque
        model.refuse_other_robot(the_robot, str(model_path))
        for measurement in the_plan.measurements:
            if not isinstance(measurement, Trajectory):
                raise FileError(
                    f"{plan_file}: {measurement.id} is of kind {measurement.kind}, and only"
                    " trajectories are streamed; make a plan of them with: hil trajectory plan"
                )
            refuse_beyond_torque(measurement, the_robot, predict)
    how = OnBus(**vars(where), realtime=realtime)
    once = the_plan.model_copy(update={"attempts": 1})  # an error of following is the result
    for name, velocity, torque in (
        ("both", True, predict),
        ("velocity", True, None),
        ("neither", False, None),
    ):
        feeding = partial(FeedingBus, velocity=velocity, predict=torque, delay=delay, loop=loop)
        say(f"{name}:")
        folder = output / name
        going_on = resume and folder.exists()
        measure(once, the_robot, plan_file, folder, how, going_on, in_front=feeding, feeds=True)
    _show(output, str(file_of(model_path)), delay)


def _show(output: Path, model: str, delay: float) -> None:
    from hil.report.pictures import write_tracking_plot
    from hil.results.tables.terminal import show
    from hil.results.tracking import PASSES, tracked, tracking, write_tracking
    from hil.runs.run import Run

    with working("comparing the passes"):
        runs = {name: Run.open(output / name) for name in PASSES}
        found = tracked(runs, model, delay)
    say_simulated(*runs.values())
    show(tracking(found), out)
    file = write_tracking(output, found)
    say(f"following errors in {file}, plot in {write_tracking_plot(output, runs, delay)}")
