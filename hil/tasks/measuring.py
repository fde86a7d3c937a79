"""Checking a plan against robot and drives, and measuring a plan into a folder.

This is the only module below the commands that knows both identification and a concrete bus:
simulation and hardware differ only in the arguments of `open_drive_bus`.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError, line_of
from hil.planning.dry_run import dry_run as checked
from hil.planning.plan import opened_plan, repeat_measurements
from hil.runs import SIMULATED
from hil.runs.atomic_file import locked
from hil.tasks.robot_drives import (
    bus_cycle,
    following_of,
    known_drives,
    load_robots_drives,
    narrowed_drives,
    packaged_drives,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from drivers.drives_file import DrivesFile
    from hil.measuring.events import Event
    from hil.model.robot import Robot
    from hil.planning.dry_run import DryRun
    from hil.planning.plan import Plan
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
