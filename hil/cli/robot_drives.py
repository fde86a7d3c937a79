"""The drives of a plan's robot: found, held against the robot file, narrowed to a workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from drivers.drives_file import load_drives
from hil.cli.robot_match import StatedAxis, refuse_contradictions
from hil.model.robot import ROBOTS
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from pathlib import Path

    from drivers.drives_file import DrivesFile
    from hil.model.robot import Robot
    from hil.planning.workspace import Workspace


def packaged_drives(the_robot: Robot) -> Path:
    """Return the path of the drives file that comes with a robot.

    Raises
    ------
    FileError
        None does.
    """
    path = _packaged(the_robot)
    if not path.exists():
        raise FileError(f"{the_robot.name}: no drives file comes along; give one with --drives")
    return path


def _packaged(the_robot: Robot) -> Path:
    return ROBOTS / f"{the_robot.name}.drives.yaml"


def known_drives(the_robot: Robot, path: Path | None) -> DrivesFile | None:
    """Return the drives by their file, or by the one that comes along; None if none does.

    Raises
    ------
    FileError
        The file cannot be used, or is of another number of axes.
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
    """Read a drives file; return it and its text.

    Raises
    ------
    FileError
        It cannot be used, or contradicts the robot file.
    """
    drives = load_drives(path)
    with file_errors(path, "read"):
        text = path.read_text(encoding="utf-8")
    axes = [
        StatedAxis(
            axis.name,
            axis.joint,
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


def narrowed_drives(drives: DrivesFile, workspace: Workspace | None) -> DrivesFile:
    """Give driver and drives the joint ranges of the workspace too."""
    axes = list(drives.axes)
    for joint, (low, high) in (workspace.ranges if workspace else {}).items():
        axis = axes[joint - 1]
        limits = axis.limits.model_copy(update={"q_min": low, "q_max": high})
        axes[joint - 1] = axis.model_copy(update={"limits": limits})
    return drives.model_copy(update={"axes": tuple(axes)})
