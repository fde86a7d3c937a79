"""The robot that a map names, with what the map knows better than the robot's own file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from checked_files.yaml_file import FileError
from hil.errors import UnknownName
from hil.model.drive_train_file import UNKNOWN
from hil.model.robot import Robot, available_robots, load_robot, parse_robot, robot_from_urdf

if TYPE_CHECKING:
    from hil.imports.map_file import MapFile

_UNKNOWN_DRIVE = dict.fromkeys(("gear_ratio", "rotor_inertia", "torque_constant"), UNKNOWN)


def robot_of(the_map: MapFile) -> Robot:
    """Load the robot of a map, with the uncertainties of the map's gains.

    Raises
    ------
    FileError
        There is none, or it cannot be used.
    """
    try:
        robot = _stated(the_map)
    except (FileError, UnknownName) as error:
        raise the_map.wrong(("robot",), str(error)) from error
    return _with_uncertainties(the_map, robot)


def _stated(the_map: MapFile) -> Robot:
    stated = the_map.content.robot
    if stated.urdf is not None:
        urdf = the_map.beside(stated.urdf)
        return robot_from_urdf(urdf, stated.base, stated.tip, stated.gravity)
    name = str(stated.name)
    known = name in available_robots() or not Path(name).suffix
    return load_robot(name if known else the_map.beside(name))


def _with_uncertainties(the_map: MapFile, robot: Robot) -> Robot:
    """Carry each stated uncertainty of a gain as that of the joint's torque constant.

    Both scale all torques of the joint, and estimates know the latter.
    """
    relative = [j.torque.gain_uncertainty / j.torque.worth for j in the_map.content.joints]
    if not any(relative) or len(relative) != robot.n_joints:
        return robot
    content = robot.file.model_dump(mode="json", exclude_none=True)
    for joint, uncertainty in zip(content["joints"], relative, strict=True):
        if uncertainty:
            drive = joint.setdefault("drive", dict(_UNKNOWN_DRIVE))
            drive["torque_constant_uncertainty"] = uncertainty
    text = yaml.safe_dump(content, sort_keys=False, width=200)
    return parse_robot(f"# {robot.source}, with the gains' uncertainties\n{text}", robot.source)
