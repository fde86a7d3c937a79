"""`hil run`: a plan measured into a folder, on a bus of drives or on the virtual plant.

This is the one place that knows both identification and a concrete bus: simulation and hardware
part at `open_drive_bus`, by its arguments.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from checked_files.yaml_file import FileError
from drivers.canopen_bus import open_drive_bus
from drivers.drives_file import load_drives
from hil.cli import bus_access, drive_settings
from hil.cli.arguments import BusOptions, RealTime, bus_options, refuse_no_channel
from hil.cli.planning import PlanFile, RobotOption, WorkspaceOption, load, refuse_problems
from hil.cli.robot_match import StatedAxis, refuse_contradictions
from hil.cli.run_session import carry_out, prepare_folder
from hil.measuring.rehearsal import SPEED
from hil.model.robot import ROBOTS
from hil.planning.dry_run import dry_run
from hil.runs.atomic_file import operator_told
from hil.runs.journal import SIMULATED
from hil.terminal.console import out

if TYPE_CHECKING:
    from drivers.drives_file import DrivesFile
    from hil.model.robot import Robot
    from hil.planning.workspace import Workspace

commands = typer.Typer()


class Pacing(StrEnum):
    """Where the time of SYNC comes from."""

    AUTO = "auto"
    LOCK_STEP = "lock-step"
    WALL_CLOCK = "wall-clock"


@commands.command()
def run(
    plan_file: PlanFile,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the run.")],
    interface: Annotated[str, typer.Option(help="python-can's interface.")] = SIMULATED,
    channel: Annotated[
        str | None, typer.Option(help="Its channel; on sim_plant by default the robot's name.")
    ] = None,
    drives_file: Annotated[
        Path | None, typer.Option("--drives", help="Drives file; by default that of the robot.")
    ] = None,
    bus_option: BusOptions = None,
    resume: Annotated[bool, typer.Option("--resume", help="Measure what is missing.")] = False,
    pacing: Annotated[Pacing, typer.Option(help="Where SYNC's time comes from.")] = Pacing.AUTO,
    frame_log: Annotated[
        Path | None, typer.Option(help="Log all frames too: .asc, .log, .blf or the like.")
    ] = None,
    robot_file: RobotOption = None,
    workspace: WorkspaceOption = None,
    rehearse: Annotated[
        bool, typer.Option("--rehearse", help="Pass all ways slowly first, recording nothing.")
    ] = False,
    speed: Annotated[
        float, typer.Option(min=0.01, max=1, help="Of a rehearsal, as share of the limits.")
    ] = SPEED,
    symmetric: Annotated[
        Path | None,
        typer.Option(help="Run whose friction must have been found symmetric, or nothing moves."),
    ] = None,
    what_changes: Annotated[
        bool,
        typer.Option(
            "--what-changes", help="List what would be written to the drives; write nothing."
        ),
    ] = False,
    realtime: RealTime = False,
) -> None:
    """Measure a plan into a folder; the robot moves."""
    the_plan, the_robot = load(plan_file, robot_file, workspace)
    if symmetric is not None:
        _gate(symmetric, the_robot)
    refuse_no_channel(interface, channel)
    channel = channel or the_robot.name
    drives_file = drives_file or _packaged_drives(the_robot)
    drives, text = _load_drives(drives_file, the_robot)
    drives = _narrowed(drives, the_plan.workspace)
    refuse_problems(dry_run(the_plan, the_robot, drives.bitrate), plan_file)
    options = bus_options(bus_option)
    if what_changes:
        kept = drive_settings.kept_in(output, interface, channel)
        with bus_access.opened(interface, channel, drives.bitrate, bus_option) as bus:
            drive_settings.show_changes(drives, bus, kept)
        out.print("nothing was written, nothing was powered", highlight=False)
        return
    with drive_settings.keeper_of_run(output, interface, channel) as keeper:
        folder = prepare_folder(output, the_plan, the_robot, text, resume, out)
        carry_out(
            folder,
            lambda: open_drive_bus(
                drives, interface, channel, options, pacing.value, frame_log, keeper
            ),
            f"{interface} {channel}",
            out,
            speed if rehearse else None,
            lambda: bus_access.real_time_if(realtime, lock_step=_in_lock_step(interface, pacing)),
        )


def _gate(folder: Path, the_robot: Robot) -> None:
    from hil.results.friction_gate import refuse_asymmetric  # noqa: PLC0415 - slow to import

    for line in refuse_asymmetric(folder, the_robot):
        out.print(line, style="yellow", highlight=False, soft_wrap=True)


def _in_lock_step(interface: str, pacing: Pacing) -> bool:
    return pacing is Pacing.LOCK_STEP or (pacing is Pacing.AUTO and interface == SIMULATED)


def _packaged_drives(the_robot: Robot) -> Path:
    path = ROBOTS / f"{the_robot.name}.drives.yaml"
    if not path.exists():
        raise FileError(f"{the_robot.name}: no drives file comes along; give one with --drives")
    return path


def _load_drives(path: Path, the_robot: Robot) -> tuple[DrivesFile, str]:
    """Read a drives file and refuse one that contradicts the robot's."""
    drives = load_drives(path)
    with operator_told(path, "read"):
        text = path.read_text(encoding="utf-8")
    axes = [
        StatedAxis(
            axis.name,
            axis.gear_ratio,
            axis.torque_constant,
            axis.limits.q_min,
            axis.limits.q_max,
            axis.limits.velocity,
            axis.limits.acceleration,
            axis.limits.torque,
        )
        for axis in drives.axes
    ]
    refuse_contradictions(axes, the_robot, text, str(path))
    return drives, text


def _narrowed(drives: DrivesFile, workspace: Workspace | None) -> DrivesFile:
    """Give driver and drives the joint ranges of the workspace too."""
    axes = list(drives.axes)
    for joint, (low, high) in (workspace.ranges if workspace else {}).items():
        axis = axes[joint - 1]
        limits = axis.limits.model_copy(update={"q_min": low, "q_max": high})
        axes[joint - 1] = axis.model_copy(update={"limits": limits})
    return drives.model_copy(update={"axes": tuple(axes)})
