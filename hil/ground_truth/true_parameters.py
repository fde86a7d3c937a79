"""The truth about the virtual plant, for whoever sets an estimate against it afterwards.

Only `hil compare` and benchmarks come here; nothing that measures or estimates does. Of the plant
file just the machine is read (`hil.ground_truth.plant_file`): whether it is the robot's
(`hil.ground_truth.other_machine`), and its standard parameters of eq. (5), and from these the base
parameters that an identification should find.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.near import did_you_mean
from checked_files.yaml_file import FileError, load_yaml
from hil.errors import UnknownName
from hil.ground_truth.other_machine import refuse_other_machine
from hil.ground_truth.plant_file import Plant, find_plant, packaged_plants
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import influences

if TYPE_CHECKING:
    from pathlib import Path

    from hil.arrays import Array
    from hil.model.robot import Robot


_TOLERANCE = 1e-9


def true_parameters(robot: Robot, plant: Path | str) -> Array:
    """Base parameters of a virtual plant.

    Parameters
    ----------
    robot : Robot
        As identified: its base parameters are meant.
    plant : path or str
        Plant file, or the name of one that comes along.

    Returns
    -------
    ndarray, shape (n_base,)
        ``K @ standard``, K being `BaseParameters.matrix`.

    Raises
    ------
    FileError
        Another machine, or a plant whose torques no base parameters of `robot` can
        give.
    UnknownName
        Neither a file nor a plant that comes along.
    """
    path = find_plant(plant)
    if not path.exists():
        known = [each.stem for each in packaged_plants()]
        raise UnknownName(
            f"{plant}: no plant file, nor the name of a plant that comes along"
            f"{did_you_mean(str(plant), known)}; available: {', '.join(known) or 'none'}"
        )
    content = load_yaml(path, Plant)
    refuse_other_machine(robot, content, path)
    standard = np.append(content.standard(), content.drives(robot))
    p: Array = base_parameters(robot).matrix @ standard
    _refuse_other_links(robot, standard, p, path)
    return p


def _refuse_other_links(robot: Robot, standard: Array, p: Array, path: Path) -> None:
    """Refuse links with parameters that matter and that the robot file calls absent or tied."""
    mass, gravity = influences(robot)
    rows = np.vstack([mass.reshape(-1, standard.size), gravity.reshape(-1, standard.size)])
    true = rows @ standard
    missed = np.abs(true - rows @ base_parameters(robot).placement @ p).max()
    if missed > _TOLERANCE * np.abs(true).max():
        names = robot.standard_parameters
        absent = [n for n, v in zip(names, standard, strict=True) if v and n not in robot.present]
        raise FileError(
            f"{path}: no base parameters of {robot.name} give this plant's torques:"
            f" {', '.join(absent) or 'a tied parameter differs from the one it is tied to'};"
            " add what the plant has to the robot file and plan anew"
        )
