"""The noise that a prediction assumes: that of earlier runs, or what files state of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from drivers.axis import AxisScale
from hil.cli.robot_drives import known_drives
from hil.planning.prediction.noise import stated_noise

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.estimation.noise_levels import Levels
    from hil.model.robot import Robot
    from hil.planning.prediction.noise import Noise
    from hil.runs.run import Run


def noise_of(robot: Robot, run: Path | None, drives_file: Path | None = None) -> Noise:
    """Noise that an earlier run shows, or else what robot file and drives file let expect.

    Raises
    ------
    FileError
        The run is of another robot.
    """
    if run is None:
        return stated_noise(robot, *_resolutions(robot, drives_file))
    folders, levels = experience_of([run])
    if folders[0].robot.digest != robot.digest:
        raise FileError(
            f"{run}: was measured with another robot file of {folders[0].robot.name} than this plan"
            f" is for; leave --noise-from out, or name a run of {robot.name} as it is now"
        )
    return levels.noise


def experience_of(runs: Sequence[Path]) -> tuple[list[Run], Levels]:
    """Open runs of one robot; return them, with the noise and the information in them."""
    from hil.results.prior_knowledge import experience
    from hil.runs.pooling import open_runs

    folders = open_runs(runs)
    return folders, experience(folders)


def _resolutions(
    robot: Robot, drives_file: Path | None
) -> tuple[list[float] | None, list[float] | None]:
    """Smallest steps of torques and positions, if a drives file states them [N m], [rad]."""
    drives = known_drives(robot, drives_file)
    if drives is None:
        return None, None
    scales = [AxisScale.of(axis) for axis in drives.axes]
    return [abs(scale.torque) for scale in scales], [abs(scale.position) for scale in scales]
