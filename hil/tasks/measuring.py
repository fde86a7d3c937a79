"""Drives of a robot, checking a plan against robot and drives, and measuring a plan into a folder.

This is the only module below the commands that knows both identification and a concrete bus:
simulation and hardware differ only in the arguments of `open_drive_bus`.

Robot file and drives file both state joint types, gear ratios, torque constants and limits, since
each is used without the other. A contradiction would scale all torques by a common factor,
invisible in any residual. So they are compared before anything moves. Drives also determine the bus
load of a plan, and the resolution of torques and positions.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from checked_files.yaml_file import FileError, line_of, read_text, refuse
from drivers.axis import AxisScale
from drivers.drives_file import load_drives
from hil.estimation.consistent.conditions import sized_bodies
from hil.measuring.feeding import DELAY
from hil.model.robot import ROBOTS
from hil.planning import BITRATE
from hil.planning.dry_run import BusCycle
from hil.planning.dry_run import dry_run as checked
from hil.planning.plan import opened_plan, repeat_measurements
from hil.planning.prediction.noise import stated_noise
from hil.planning.trajectory import Following
from hil.runs import SIMULATED
from hil.runs.atomic_file import locked

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from drivers.drives_file import AxisDrive, DrivesFile
    from hil.arrays import Array
    from hil.estimation.noise_levels import Levels
    from hil.measuring.sequencer import Event
    from hil.model.robot import Robot
    from hil.planning.dry_run import DryRun
    from hil.planning.plan import Plan
    from hil.planning.prediction.noise import Noise
    from hil.planning.workspace import Workspace
    from hil.runs.run import Run
    from hil.runs.run_folder import RunFolder


def dry_run(
    plan: Plan | Path | str,
    robot: Robot | Path | str | None = None,
    *,
    drives: Path | None = None,
    bitrate: int | None = None,
    workspace: Path | None = None,
) -> DryRun:
    """Check a plan against all limits, and predict duration and precision.

    Nothing moves and no bus is opened.

    Parameters
    ----------
    plan : Plan or path
    robot : Robot, path or str, optional
        Robot, by default the one named in the plan.
    drives : path, optional
        Drives file; by default the built-in one of the robot, if any.
    bitrate : int, optional
        Bit rate in place of that of the drives file [bit/s].
    workspace : path, optional
        Workspace file in place of the plan's own.

    Returns
    -------
    DryRun
        Result of the dry run, with `problems` empty for a valid plan.

    Raises
    ------
    FileError
        One of the files cannot be used.

    Examples
    --------
    >>> checked = hil.dry_run(hil.plan("manutec-r15", "friction", axis=[6]))
    >>> checked.problems, round(checked.durations["friction"])  # [s]
    ((), 207)
    """
    the_plan, the_robot = opened_plan(plan, robot, workspace)
    own = known_drives(the_robot, drives)
    cycle = bus_cycle(the_plan, the_robot.n_joints, own, bitrate)
    return checked(the_plan, the_robot, cycle, following_of(own, the_plan.sample_period))


def checked_drives(
    plan: Plan, robot: Robot, drives_file: Path | None, source: Path | None, *, feeds: bool = False
) -> tuple[DrivesFile, str]:
    """Return the drives of a robot suitable for a plan, and the text of the drives file.

    Raises
    ------
    FileError
        No drives file, a drives file that contradicts the robot, or a plan with problems.
    """
    drives, text = load_robots_drives(drives_file or packaged_drives(robot), robot)
    drives = narrowed_drives(drives, plan.workspace)
    cycle = bus_cycle(plan, robot.n_joints, drives, feeds=feeds)
    following = following_of(drives, plan.sample_period)
    refuse_problems(checked(plan, robot, cycle, following), source)
    return drives, text


def refuse_problems(result: DryRun, source: Path | None) -> None:
    """Refuse a plan with problems in the dry run.

    Parameters
    ----------
    source : Path or None
        Name of the plan in messages; lines are stated for an existing file.

    Raises
    ------
    FileError
        Message with the problems.
    """
    if result.problems:
        text = source.read_text(encoding="utf-8") if source and source.is_file() else ""
        raise FileError(describe_problems(result, text, str(source or "plan")))


def describe_problems(result: DryRun, text: str, source: str, most: int = 10) -> str:
    """Return a line for each problem up to `most`, with the place in the plan's `text`."""
    lines = [
        f"{source}:{line_of(text, problem.location)}:"
        f" {'.'.join(map(str, problem.location))}: {problem.message}"
        for problem in result.problems[:most]
    ]
    more = len(result.problems) - most
    return "\n".join([*lines, f"... and {more} more problems of the plan"] if more > 0 else lines)


def measure(
    plan: Plan | Path | str,
    output: Path | str,
    robot: Robot | Path | str | None = None,
    *,
    drives: Path | None = None,
    interface: str = SIMULATED,
    channel: str | None = None,
    options: Mapping[str, object] | None = None,
    resume: bool = False,
    on_event: Callable[[Event], None] = lambda _: None,
) -> Run:
    """Measure a plan into a run folder; the robot moves.

    The function does the work of `hil run` without a terminal: there are no questions and no keys.
    Ctrl-C stops the campaign. At any end of the campaign the axes stop and are switched off;
    recordings stay, and `resume` measures the rest.

    Parameters
    ----------
    plan : Plan or path
    output : path
        Run folder to write.
    robot : Robot, path or str, optional
        Robot, by default the one named in the plan.
    drives : path, optional
        Drives file; by default the built-in one of the robot.
    interface, channel : str
        Names of python-can; by default the virtual plant of the robot.
    options : mapping, optional
        Further arguments of the interface.
    resume : bool
        True to continue a stopped run.
    on_event : callable
        Function called with each event of the campaign, such as a finished recording.

    Returns
    -------
    Run

    Raises
    ------
    FileError
        The plan has problems, or the folder contains another run.
    DriveError
        Drives or bus failed.

    Examples
    --------
    >>> plan = hil.plan("manutec-r15")
    >>> short = plan.model_copy(update={"measurements": plan.measurements[:1]})
    >>> hil.measure(short, "runs/short")  # the virtual robot, without options
    <Run runs/short: manutec-r15, 1 of 1 measurements>
    """
    # a dry run needs neither a bus nor recordings
    from drivers.opening import open_drive_bus
    from hil.measuring.campaign import run_campaign
    from hil.runs.journal import BusName
    from hil.runs.run import Run
    from hil.tasks.bus_state import keeper_of_run

    output = Path(output)
    the_plan, the_robot = opened_plan(plan, robot)
    named = Path(plan) if isinstance(plan, (str, Path)) else None
    own, text = checked_drives(the_plan, the_robot, drives, named)
    channel = channel or the_robot.name
    with keeper_of_run(output, interface, channel) as keeper:
        folder = prepared_folder(
            output, repeat_measurements(the_plan, 1), the_robot, text, resume=resume
        )[0]
        if folder.missing:
            with locked(folder.path):
                bus = open_drive_bus(own, interface, channel, options, keeper=keeper)
                with closing(run_campaign(folder, bus, BusName(interface, channel))) as happening:
                    for event in happening:
                        on_event(event)
    return Run.open(output)


def refuse_unusable(path: Path, resume: bool) -> None:
    """Refuse a folder with unsuitable content, before checking the plan.

    Raises
    ------
    FileError
        A run exists already, or there is none to resume.
    """
    from hil.runs.run_folder import RunFolder

    if RunFolder.is_stub(path):
        return
    if resume or (path / "run.json").exists():
        folder = RunFolder.open(path)
        if resume or folder.only_rehearsed:
            return
    RunFolder.refuse_taken(path)


def prepared_folder(
    path: Path, plan: Plan, robot: Robot, drives: str, *, resume: bool
) -> tuple[RunFolder, list[str]]:
    """Make the folder of a new run, or open a folder to be resumed or only rehearsed so far.

    Returns
    -------
    RunFolder, list of str
        Folder, and messages about damaged files set aside.

    Raises
    ------
    FileError
        A run exists already, or the run to be resumed has another plan.
    """
    from hil.runs.run_folder import RunFolder

    resume = resume and not RunFolder.is_stub(path)
    folder = RunFolder.open(path) if resume or (path / "run.json").exists() else None
    if folder is None or not (resume or folder.only_rehearsed):
        return RunFolder.create(path, plan, robot, drives), []
    folder.refuse_changes(plan, robot, drives)
    return folder, list(folder.set_aside_damaged())


def packaged_drives(the_robot: Robot) -> Path:
    """Return the path of the drives file packaged with a robot.

    Raises
    ------
    FileError
        No drives file is packaged.
    """
    path = _packaged(the_robot)
    if not path.exists():
        raise FileError(f"{the_robot.name}: no packaged drives file; give one with --drives")
    return path


def _packaged(the_robot: Robot) -> Path:
    return ROBOTS / f"{the_robot.name}.drives.yaml"


def known_drives(the_robot: Robot, path: Path | None) -> DrivesFile | None:
    """Return the drives of a file, or of the packaged file; None without either.

    Raises
    ------
    FileError
        The file cannot be used, or has another number of axes.
    """
    packaged = _packaged(the_robot)
    if path is None and not packaged.exists():
        return None
    path = path or packaged
    drives = load_drives(path)
    if len(drives.axes) != the_robot.n_joints:
        raise FileError(
            f"{path}: {len(drives.axes)} axes must be {the_robot.n_joints}, one for each joint of"
            f" {the_robot.name}"
        )
    return drives


def load_robots_drives(path: Path, the_robot: Robot) -> tuple[DrivesFile, str]:
    """Read a drives file; return the drives and the text.

    Raises
    ------
    FileError
        The file cannot be used, or contradicts the robot file.
    """
    drives = load_drives(path)
    text = read_text(path)
    refuse(str(path), text, _contradictions(drives.axes, the_robot))
    return drives, text


def narrowed_drives(drives: DrivesFile, workspace: Workspace | None) -> DrivesFile:
    """Limit driver and drives to the joint ranges of the workspace."""
    axes = list(drives.axes)
    for joint, (low, high) in (workspace.ranges if workspace else {}).items():
        axis = axes[joint - 1]
        limits = axis.limits.model_copy(update={"q_min": low, "q_max": high})
        axes[joint - 1] = axis.model_copy(update={"limits": limits})
    return drives.model_copy(update={"axes": tuple(axes)})


def _contradictions(
    axes: Sequence[AxisDrive], robot: Robot
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Yield the contradictions between drives and robot; of an axis of another type only this.

    Limits contradict if wider than the robot's, or so narrow that a plan would reach them.
    """
    if len(axes) != robot.n_joints:
        yield (
            ("axes",),
            f"{len(axes)} axes must be {robot.n_joints}, one for each joint of {robot.name}",
        )
        return
    # tolerances of numbers, and of limits narrower than the robot's; wider limits are refused
    same, narrower = 1e-3, 5e-3
    both = f"as in the robot file of {robot.name}; correct whichever is wrong"
    for index, axis in enumerate(axes):
        place: tuple[str | int, ...] = "axes", index
        joint = "revolute" if robot.revolute[index] else "prismatic"
        if axis.joint != joint:
            yield (*place, "joint"), f"{axis.joint} of axis {axis.name} must be {joint} {both}"
            continue
        for key in ("gear_ratio", "torque_constant"):
            stated, known = getattr(axis, key), float(getattr(robot, key)[index])
            if stated is not None and abs(stated - known) > same * abs(known):
                yield (*place, key), f"{stated:g} of axis {axis.name} must be {known:g} {both}"
        limits, low, high = axis.limits, float(robot.q_min[index]), float(robot.q_max[index])
        q, tau = robot.position_unit(index), robot.torque_unit(index)
        velocity, acceleration, torque = (
            float(limit[index])
            for limit in (robot.velocity_limit, robot.acceleration_limit, robot.torque_limit)
        )
        for key, stated, known, unit in (
            ("q_min", -limits.q_min, -low, q),
            ("q_max", limits.q_max, high, q),
            ("velocity", limits.velocity, velocity, f"{q}/s"),
            ("acceleration", limits.acceleration, acceleration, f"{q}/s^2"),
            ("torque", limits.torque, torque, tau),
        ):
            slack = high - low if unit == q else known
            if -narrower * slack <= stated - known <= same * slack:
                continue
            sign, relation = -1 if key == "q_min" else 1, "wider" if stated > known else "narrower"
            yield (
                (*place, "limits", key),
                f"{sign * stated:g} {unit} of axis {axis.name} is {relation} than"
                f" {sign * known:g} {unit} in the robot file of {robot.name}; state one value in"
                " both",
            )


def bus_cycle(
    plan: Plan,
    n_axes: int,
    drives: DrivesFile | None,
    bitrate: int | None = None,
    *,
    feeds: bool = False,
) -> BusCycle:
    """Return the bus load of a cycle while `plan` is measured.

    Parameters
    ----------
    drives : DrivesFile or None
        Drives, None if unknown: a TPDO of 8 bytes per axis is assumed.
    bitrate : int, optional
        Bit rate in place of the drives file's [bit/s].
    feeds : bool
        True if velocity and torque are fed forward to the drives.
    """
    from drivers.opening import cycle_on_bus

    streamed = any(measurement.streamed for measurement in plan.measurements)
    rate = bitrate or (drives.bitrate if drives else BITRATE)
    found = cycle_on_bus(drives, n_axes, rate, streamed=streamed, feed_forward=feeds)
    duration, frames, most = found
    return BusCycle(duration, rate, frames, most)


def following_of(drives: DrivesFile | None, period: float | None = None) -> Following | None:
    """Return following tolerance and delay of the axes on a trajectory; None if not known.

    Parameters
    ----------
    period : float, optional
        SYNC period, by default that of the drives file [s].
    """
    if drives is None:
        return None
    late = DELAY * (period or drives.sync_period)
    columns = [
        (axis.following_error_window, axis.following_error_time, axis.position_lag + late)
        for axis in drives.axes
    ]
    return Following(*np.array(columns).T)


class Expected(NamedTuple):
    """Noise and base parameters, shape (n_base,), for predictions, with the source."""

    noise: Noise
    p: Array
    source: str


def expected_of(robot: Robot, run: Path | None, drives_file: Path | None = None) -> Expected:
    """Return noise and parameters of an earlier run, or else expected from the files.

    Raises
    ------
    FileError
        The run is of another robot.
    """
    if run is None:
        drives, noise = known_drives(robot, drives_file), stated_noise(robot)
        if drives is not None:
            scales = [AxisScale.derive(axis) for axis in drives.axes]
            steps = [each.torque_step for each in scales], [abs(each.position) for each in scales]
            noise = stated_noise(robot, *steps)
        return Expected(noise, sized_bodies(robot), "of rods as heavy as the drives can hold")
    folders, levels = experience_of([run])
    if folders[0].robot.digest != robot.digest:
        raise FileError(
            f"{run}: was measured with another robot file of {folders[0].robot.name} than this "
            f"plan is for; omit --noise-from, or name a run with the present file of {robot.name}"
        )
    return Expected(levels.noise, levels.p, "as in an earlier run")


def experience_of(runs: Sequence[Path]) -> tuple[list[Run], Levels]:
    """Open runs of a robot; return the runs with noise and information."""
    from hil.results.identification import experience
    from hil.runs.pooling import open_runs

    folders = open_runs(runs)
    return folders, experience(folders)
