"""The command line: from a robot to a plan, a run, an identified model and a report.

Commands are thin: each one reads its files, calls one function of a module below and prints. What
is wrong with files, drives or the bus ends in one message on standard error and a non-zero status,
never in a traceback. This is also the one place that knows both identification and a concrete
bus: `_open_bus` is where simulation and hardware part, by an argument.
"""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from drivers.drive_bus import DriveError
from drivers.yaml_file import FileError
from hil.cli import (
    commissioning,
    drive_commands,
    drive_settings,
    findings,
    first_steps,
    friction,
    monitoring,
    planning,
    study,
    trajectory,
)
from hil.measuring.atomic_file import operator_told
from hil.measuring.rehearsal import SPEED
from hil.measuring.run_folder import RunFolder
from hil.measuring.run_journal import SIMULATED
from hil.model.robot import ROBOTS, load_robot
from hil.planning.dry_run import BITRATE, dry_run
from hil.planning.plan import load_plan, refuse_other_robot
from hil.terminal import dry_run_view, robot_view
from hil.terminal.drives_check import StatedAxis, refuse_contradictions
from hil.terminal.run_command import (
    bus_options,
    carry_out,
    prepare_folder,
    show_remarks,
    with_workspace,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import DriveBus
    from drivers.drives_file import DrivesFile
    from drivers.settings_keeper import SettingsKeeper
    from hil.model.robot import Robot
    from hil.planning.dry_run import DryRun
    from hil.planning.plan import Plan
    from hil.planning.workspace import Workspace

app = typer.Typer(
    help="Identify a robot's dynamics on the machine itself, over CANopen.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(planning.commands)
app.add_typer(first_steps.commands)
first_steps.drives_commands.command()(drive_settings.restore)
app.add_typer(commissioning.commands)
app.add_typer(monitoring.commands)
app.add_typer(findings.commands)
app.add_typer(friction.commands, name="friction")
app.add_typer(trajectory.commands, name="trajectory")
app.add_typer(study.commands, name="study")
out = Console()

PlanFile = Annotated[Path, typer.Argument(help="Plan as YAML.")]
RunPath = Annotated[Path, typer.Argument(help="Folder of a run.")]
WorkspaceOption = Annotated[
    Path | None,
    typer.Option("--workspace", help="Joint ranges and forbidden boxes; else those of the plan."),
]
RobotOption = Annotated[
    str | None, typer.Option("--robot", help="Robot file, if the robot does not come along.")
]


class Pacing(StrEnum):
    """Where the time of SYNC comes from."""

    AUTO = "auto"
    LOCK_STEP = "lock-step"
    WALL_CLOCK = "wall-clock"


class Method(StrEnum):
    """How parameters are estimated."""

    IMPROVED = "improved"
    PRINTED = "printed"


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of `hil`; exit status 1 for what a message tells, 2 for wrong usage."""
    try:
        app(None if arguments is None else list(arguments), prog_name="hil")
    except (FileError, DriveError) as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(1)
    except OSError as error:
        sys.stderr.write(f"{error.filename or 'hil'}: {error.strerror or error}\n")
        sys.exit(1)


@app.command()
def robot(name: Annotated[str, typer.Argument(help="Name, or path of a robot file.")]) -> None:
    """Show base parameters, their groups, and where they occur in M and g."""
    robot_view.render(load_robot(name), out)


@app.command("dry-run")
def dry_run_(
    plan_file: PlanFile,
    robot_file: RobotOption = None,
    bitrate: Annotated[int, typer.Option(min=10_000, max=1_000_000, help="bit/s")] = BITRATE,
    workspace: WorkspaceOption = None,
    noise_from: planning.NoiseFrom = None,
    drives_file: Annotated[
        Path | None, typer.Option("--drives", help="Drives file, for the torques' resolution.")
    ] = None,
) -> None:
    """Tell what a plan will take and give; nothing moves."""
    the_plan, the_robot = _load(plan_file, robot_file, workspace)
    result = _dry_run(plan_file, the_plan, the_robot, bitrate, quiet=False)
    if result.groups:
        from hil.planning.precision import predict  # noqa: PLC0415 - slow to import, used here only
        from hil.terminal import precision_view  # noqa: PLC0415 - slow to import, used here only

        noise = planning.noise_of(the_robot, noise_from, drives_file)
        found = predict(the_robot, the_plan.measurements, the_plan.sample_period, noise)
        precision_view.render(found, the_robot, out)


@app.command()
@friction.commands.command()
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
    bus_option: Annotated[
        list[str] | None, typer.Option(help="key=value for python-can, may be repeated.")
    ] = None,
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
    realtime: drive_commands.RealTime = False,
) -> None:
    """Measure a plan into a folder; the robot moves."""
    the_plan, the_robot = _load(plan_file, robot_file, workspace)
    if symmetric is not None:
        _gate(symmetric, the_robot)
    channel = channel or _default_channel(interface, the_robot)
    drives_file = drives_file or _packaged_drives(the_robot)
    drives, text = _load_drives(drives_file, the_robot)
    drives = _narrowed(drives, the_plan.workspace)
    _dry_run(plan_file, the_plan, the_robot, drives.bitrate, quiet=True)
    options = bus_options(bus_option or [])
    if what_changes:
        kept = drive_settings.kept_in(output, interface, channel)
        _show_changes(drives, interface, channel, options, kept)
        return
    with drive_settings.keeper_of_run(output, interface, channel) as keeper:
        folder = prepare_folder(output, the_plan, the_robot, text, resume, out)
        carry_out(
            folder,
            lambda: _open_bus(drives, interface, channel, options, pacing, frame_log, keeper),
            f"{interface} {channel}",
            out,
            speed if rehearse else None,
            lambda: drive_commands.real_time_if(
                realtime, lock_step=_in_lock_step(interface, pacing)
            ),
        )


@app.command()
def identify(
    folder: RunPath,
    method: Annotated[Method, typer.Option(help="Variant of the estimator.")] = Method.IMPROVED,
    others: Annotated[
        list[Path] | None,
        typer.Option("--with", help="Further run to identify it with, may be repeated."),
    ] = None,
) -> None:
    """Estimate base parameters from a run; writes model.yaml into its folder."""
    from hil.estimation.friction.symmetry import of_local_values  # noqa: PLC0415 - slow to import
    from hil.results import model_file  # noqa: PLC0415 - slow to import, used here only
    from hil.terminal import estimate_view, friction_view  # noqa: PLC0415 - slow to import

    begun = perf_counter()
    found = model_file.identify(folder, method.value, others or ())
    estimate_view.render(found, load_robot(folder / "robot.yaml"), out)
    friction_view.render_symmetry(of_local_values(found.local), out)
    for each in (folder, *(others or ())):
        _tell_shortfall(each)
    took = f"{perf_counter() - begun:.1f} s"
    out.print(f"model in {folder / model_file.NAME} ({took})", highlight=False, soft_wrap=True)


@app.command()
def report(
    folder: RunPath,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for the plots as PNG files too.")
    ] = None,
) -> None:
    """Write a run's report, one HTML file."""
    from hil.results import report as module  # noqa: PLC0415 - slow to import, used here only

    begun = perf_counter()
    path = module.report(folder, figures)
    _tell_shortfall(folder)
    out.print(f"report in {path} ({perf_counter() - begun:.1f} s)", highlight=False, soft_wrap=True)


@app.command()
def compare(
    folder: RunPath,
    truth: Annotated[str, typer.Option(help="Plant file of the virtual plant, or its name.")],
    method: Annotated[Method, typer.Option(help="Variant of the estimator.")] = Method.IMPROVED,
) -> None:
    """Set an estimate against the truth of the virtual plant."""
    from hil.results import compare as module  # noqa: PLC0415 - slow to import, used here only

    module.compare(folder, truth, out, method.value)


def _tell_shortfall(folder: Path) -> None:
    told = RunFolder.open(folder).shortfall
    if told:
        out.print(f"[yellow]{told}[/]", soft_wrap=True)


def _load(plan_file: Path, robot_file: str | None, workspace: Path | None) -> tuple[Plan, Robot]:
    the_plan = load_plan(plan_file)
    the_robot = load_robot(robot_file or the_plan.robot.name)
    refuse_other_robot(the_plan, the_robot, str(plan_file))
    the_plan = with_workspace(the_plan, the_robot, workspace)
    show_remarks(the_plan.workspace, the_robot, out)
    return the_plan, the_robot


def _dry_run(
    plan_file: Path, the_plan: Plan, the_robot: Robot, bitrate: int, *, quiet: bool
) -> DryRun:
    result = dry_run(the_plan, the_robot, bitrate)
    if not quiet:
        dry_run_view.render(result, out)
    if result.problems:
        text = plan_file.read_text(encoding="utf-8")
        raise FileError(dry_run_view.describe_problems(result, text, str(plan_file)))
    return result


def _gate(folder: Path, the_robot: Robot) -> None:
    from hil.results.friction_gate import refuse_asymmetric  # noqa: PLC0415 - slow to import

    for told in refuse_asymmetric(folder, the_robot):
        out.print(told, style="yellow", highlight=False, soft_wrap=True)


def _default_channel(interface: str, the_robot: Robot) -> str:
    if interface != SIMULATED:
        raise typer.BadParameter(
            f"interface {interface} needs a channel too, such as can0", param_hint="--channel"
        )
    return the_robot.name


def _in_lock_step(interface: str, pacing: Pacing) -> bool:
    return pacing is Pacing.LOCK_STEP or (pacing is Pacing.AUTO and interface == SIMULATED)


def _packaged_drives(the_robot: Robot) -> Path:
    path = ROBOTS / f"{the_robot.name}.drives.yaml"
    if not path.exists():
        raise FileError(f"{the_robot.name}: no drives file comes along; give one with --drives")
    return path


def _load_drives(path: Path, the_robot: Robot) -> tuple[DrivesFile, str]:
    """Read a drives file and refuse one that contradicts the robot's."""
    from drivers.drives_file import load_drives  # noqa: PLC0415 - only where a bus is used

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


def _open_bus(
    drives: DrivesFile,
    interface: str,
    channel: str,
    options: dict[str, object],
    pacing: Pacing,
    frame_log: Path | None,
    keeper: SettingsKeeper,
) -> DriveBus:
    from drivers.canopen_bus import open_drive_bus  # noqa: PLC0415 - only where a bus is used

    return open_drive_bus(drives, interface, channel, options, pacing.value, frame_log, keeper)


def _show_changes(
    drives: DrivesFile,
    interface: str,
    channel: str,
    options: dict[str, object],
    keeper: SettingsKeeper,
) -> None:
    from drivers.open_bus import open_can_bus  # noqa: PLC0415 - only where a bus is used

    with open_can_bus(interface, channel, {"bitrate": drives.bitrate, **options}) as bus:
        drive_settings.show_changes(drives, bus, keeper)
    out.print("nothing was written, nothing was powered", highlight=False)
