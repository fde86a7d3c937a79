"""Drives of a plan's robot: loading, comparison with the robot file, and predictions.

Robot file and drives file both state joint types, gear ratios, torque constants and limits, since
each is used without the other. A contradiction would scale all torques by a common factor,
invisible in any residual. So they are compared before anything moves. Drives also determine the bus
load of a plan, and the resolution of torques and positions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from checked_files.yaml_file import FileError, read_text, refuse
from drivers.axis import AxisScale
from drivers.drives_file import load_drives
from hil.estimation.consistent.conditions import sized_bodies
from hil.measuring.feeding import DELAY
from hil.model.robot import ROBOTS
from hil.planning import BITRATE
from hil.planning.dry_run import BusCycle
from hil.planning.lag import Following
from hil.planning.prediction.noise import stated_noise

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from drivers.drives_file import AxisDrive, DrivesFile
    from hil.arrays import Array
    from hil.estimation.noise_levels import Levels
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.planning.prediction.noise import Noise
    from hil.planning.workspace import Workspace
    from hil.runs.run import Run


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
