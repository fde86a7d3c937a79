"""Whether a plant is the machine that a robot file describes: parameters of another mean nothing.

Joint types, frames, gravity and gear ratios are compared, all of them, before a single parameter
is: where one differs, base parameters are other combinations of other bodies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError, line_of, place, read_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from hil.ground_truth.plant_file import Plant, PlantAxis
    from hil.model.robot import Robot

    Place = tuple[str | int, ...]

_TOLERANCE = 1e-9
_SAME_GEAR = 1e-6
_REMEDY = "parameters of another machine cannot be compared"


def refuse_other_machine(robot: Robot, plant: Plant, path: Path) -> None:
    """Refuse a plant that is another machine than the robot.

    Raises
    ------
    FileError
        One line for each difference.
    """
    differences = list(_differences(robot, plant))
    if differences:
        text = read_text(path)
        raise FileError(
            "\n".join(
                f"{path}:{line_of(text, at)}: {place(at)}: {message}" for at, message in differences
            )
        )


def _differences(robot: Robot, plant: Plant) -> Iterator[tuple[Place, str]]:
    if len(plant.axes) != robot.n_joints:
        yield (
            ("axes",),
            f"{len(plant.axes)} axes must be {robot.n_joints}, as {robot.name} has; give the file"
            " of the plant that was measured",
        )
        return
    if not np.allclose(plant.gravity, robot.gravity, atol=_TOLERANCE, rtol=0):
        yield (
            ("gravity",),
            f"{_listed(plant.gravity)} m/s2 must be {_listed(robot.gravity)} m/s2, as the robot"
            f" file says; {_REMEDY}",
        )
    for k, axis in enumerate(plant.axes):
        yield from _of_axis(robot, k, axis)


def _of_axis(robot: Robot, k: int, axis: PlantAxis) -> Iterator[tuple[Place, str]]:
    joint = "revolute" if robot.revolute[k] else "prismatic"
    if axis.joint != joint:
        yield (
            ("axes", k, "joint"),
            f"{axis.joint} must be {joint}, as the robot file says; {_REMEDY}",
        )
    frame = axis.frame
    there = (np.radians(frame.alpha_deg), frame.d, np.radians(frame.theta_deg), frame.r)
    stated = (robot.alpha[k], robot.d[k], robot.theta[k], robot.r[k])
    if not np.allclose(there, stated, atol=_TOLERANCE, rtol=0):
        yield (
            ("axes", k, "frame"),
            f"alpha, d, theta, r = {_listed(there)} must be {_listed(stated)}, as the robot file"
            " says; parameters of other frames cannot be compared",
        )
    gear, known = axis.drive.gear_ratio, float(robot.gear_ratio[k])
    if abs(gear - known) > _SAME_GEAR * known:  # never where the robot file leaves it unknown
        yield (
            ("axes", k, "drive", "gear_ratio"),
            f"{gear:g} must be {known:g}, as the robot file says: with another gear every position"
            " and torque is scaled",
        )


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)
