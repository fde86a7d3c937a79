"""Commands `hil track` and `hil watch`: a moving robot compared with a model.

`track` measures the tracking error without feed-forward, with velocity, and with velocity and
torque. `watch` compares measured torques with the model, with alarms at pushes.
"""

from __future__ import annotations

from functools import partial
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from hil.cli.arguments import (
    ModelPath,
    PlanFile,
    RealTime,
    RobotOption,
    RobotsBus,
    WorkspaceOption,
    expand_records,
)
from hil.cli.measuring import OnBus, PortsOptional, Shown, listeners
from hil.cli.outputs import (
    Status,
    folder_to_write,
    new_folder,
    output_option,
    show,
    show_causes,
    write_page,
)
from hil.terminal.console import say, working

if TYPE_CHECKING:
    from hil.planning.plan import Plan
    from hil.watching.watcher import Watcher

commands = typer.Typer()
RUN = "run"
"""Run folder within the folder of a watch."""


@commands.command()
@expand_records
def track(
    plan_file: PlanFile,
    model_path: ModelPath,
    output: Annotated[
        Path,
        output_option(
            folder_to_write, "Folder for a run per kind of feed-forward, and the result."
        ),
    ],
    *,
    where: RobotsBus,
    resume: Annotated[
        bool, Option("--resume", help="Continue a stopped comparison with its missing runs.")
    ] = False,
    delay: Annotated[
        float,
        Option(min=0, max=10, help="Delay between set-points and drive motion \\[SYNC periods]."),
    ] = 1.5,
    loop: Annotated[
        float,
        Option(
            "--loop-period", min=0, max=0.1, help="Cycle time of the drives' position loops \\[s]."
        ),
    ] = 0.001,
    robot_file: RobotOption = None,
    workspace: WorkspaceOption = None,
    realtime: RealTime = False,
) -> None:
    """Measure the tracking error without and with feed-forward; the robot moves.

    Passes the plan three times: without feed-forward, with velocity, with velocity and torque.
    """
    with working("predicting the torques of the plan"):
        from checked_files.yaml_file import FileError
        from hil.cli.measuring import measure
        from hil.cli.plan_view import load
        from hil.commands import track as command
        from hil.measuring.feeding import FeedingBus, refuse_beyond_torque
        from hil.planning.trajectory import Trajectory
        from hil.results.model import loaded
        from hil.results.model_file import file_of
        from hil.tasks.measuring import refuse_unusable

        for name in command.PASSES:
            refuse_unusable(output / name, resume and (output / name).exists())
        the_plan, the_robot = load(plan_file, robot_file, workspace)
        predict = loaded(model_path, the_robot).drive_torque
        for measurement in the_plan.measurements:
            if not isinstance(measurement, Trajectory):
                raise FileError(
                    f"{plan_file}: {measurement.id} is of kind {measurement.kind}, but only "
                    "trajectories can be streamed; plan some with: hil plan --kind trajectory"
                )
            refuse_beyond_torque(measurement, the_robot, predict)
    how = OnBus(**vars(where), realtime=realtime)
    # a following error is the result, not a reason to stop
    once = the_plan.model_copy(update={"attempts": 1})
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
    with working("comparing the passes"):
        found = command.track(output, str(file_of(model_path)), delay)
    show(found)
    write_page(output / command.PAGE, found)
    say(f"following errors in {output / command.NAME}")


@commands.command(cls=PortsOptional)
@expand_records
def watch(
    plan_file: PlanFile,
    model_path: ModelPath,
    output: Annotated[
        Path, output_option(new_folder, "Folder to write the run and its alarms into.")
    ],
    *,
    where: RobotsBus,
    repeat: Annotated[
        int | None, Option(min=1, max=100_000, help="Number of times to repeat the plan.")
    ] = None,
    hours: Annotated[
        float | None, Option(min=0, max=1000, help="Time for which to repeat the plan \\[h].")
    ] = None,
    learn: Annotated[
        float | None,
        Option(
            min=5,
            max=3600,
            help="Duration of motion without contact, from which thresholds are learned \\[s].",
            show_default="30",
        ),
    ] = None,
    thresholds: Annotated[
        Path | None,
        Option(help="Folder of an earlier watch, whose thresholds hold from the start."),
    ] = None,
    stop: Annotated[
        bool, Option("--stop", help="Stop all axes and switch them off at the first alarm.")
    ] = False,
    robot_file: RobotOption = None,
    workspace: WorkspaceOption = None,
    realtime: RealTime = False,
    shown: Shown,
) -> None:
    """Detect external forces while a plan moves the robot.

    An alarm is raised if measured torques leave the thresholds around the model's; the exit status
    is then 3.
    """
    if learn is not None and thresholds is not None:
        raise typer.BadParameter(
            "nothing is learned with --thresholds; omit --learn, or --thresholds",
            param_hint="--learn",
        )
    with working("reading plan and model"):
        from checked_files.yaml_file import FileError
        from hil.cli.measuring import measure
        from hil.cli.monitoring import WatchView
        from hil.cli.plan_view import load
        from hil.planning.timetable import timetable
        from hil.results.model import loaded
        from hil.results.model_file import file_of
        from hil.results.watch import LEARNING, load_thresholds
        from hil.runs.run import Run
        from hil.watching.watcher import TOGETHER, Watcher, WatchingBus

        the_plan, the_robot = load(plan_file, robot_file, workspace)
        model = loaded(model_path, the_robot)
        period, learning = the_plan.sample_period, learn or LEARNING
        if thresholds is None:
            watcher = Watcher(model, period, learning)
        else:
            learning, known = 0.0, load_thresholds(thresholds, model, period)
            watcher = Watcher(model, period, learning, known.axes)
        how = OnBus(**vars(where), realtime=realtime, listeners=listeners(shown, where.bus_option))
        view = WatchView(watcher, the_robot)
        if repeat is not None and hours is not None:
            raise FileError("--repeat and --hours exclude each other; give only one")
        once = sum(
            e.travel + e.duration for e in timetable(the_plan, the_robot, the_plan.measurements)
        )
        rounds = repeat or (1 if hours is None else max(1, ceil(3600 * hours / once)))
        if rounds * once <= learning:
            raise FileError(
                f"{rounds * once:.0f} s of motion in the plan must exceed the {learning:g} s in "
                "which thresholds are learned; repeat the plan, with --repeat "
                f"{int(learning / once) + 2}"
            )
    try:
        measure(
            the_plan.model_copy(update={"attempts": 1}),  # a push is the result: no repetition
            the_robot,
            plan_file,
            output / RUN,
            how,
            in_front=partial(
                WatchingBus,
                watcher=watcher,
                show=view.take,
                stop=stop,
                at_once=1 if stop else max(1, round(TOGETHER / period)),
            ),
            display=view.display,
            rounds=rounds,
            watcher=watcher,
        )
    finally:
        keep_watch(output, the_plan, watcher, str(file_of(model_path)))
    if watcher.alarms:
        # one pass of the plan from the first alarm on: a lasting change shows in a whole pass,
        # while a push is short
        run, since = Run.open(output / RUN), watcher.alarms[0].time
        ended = [each.measurement.id for each in run if each.recording.time[-1] < since]
        later = run.ids[len(ended) + len(the_plan.measurements) :]
        show_causes(model_path, run.exclude([*ended, *later]))
        raise typer.Exit(Status.ALARMED)


def keep_watch(output: Path, the_plan: Plan, watcher: Watcher, model: str) -> None:
    """Write and show the results of a watch, also after an early end."""
    from hil.commands.watch import PAGE, watch
    from hil.results.watch import NAME
    from hil.runs.run import Run

    found = watcher.found(the_plan.digest, model)
    if not (found.learned or found.watched):
        return
    run = Run.open(output / RUN) if (output / RUN / "run.json").exists() else None
    shown = watch(output, run, found, watcher.trace)
    show(shown)
    write_page(output / PAGE, shown)
    say(f"alarms and thresholds in {output / NAME}")
