"""Writing of a twin's files, checked by building the plant from them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError, load_yaml
from sim_plant.plant import load_plant
from sim_plant.twin.draft import draft_twin
from sim_plant.twin.files import DRIVES, PLANT, drives_text, plant_text
from sim_plant.twin.links import NoLinks
from sim_plant.twin.robot import RobotDescription

if TYPE_CHECKING:
    from pathlib import Path


def write_twin(robot: Path, folder: Path) -> str:
    """Write plant file and drives file of a robot's virtual twin.

    Parameters
    ----------
    robot : Path
        Robot file.
    folder : Path
        Folder for both files, created if missing; neither file may exist.

    Returns
    -------
    str
        Written files, and the next commands.

    Raises
    ------
    FileError
        The robot file cannot be used, or a file is there already.
    OSError
        A file cannot be written.
    """
    if robot.suffix == ".urdf":
        raise FileError(
            f"{robot}: a URDF states no gears and accelerations; write a robot file from it with:"
            f" hil robot new --urdf {robot} -o {robot.stem}.yaml"
        )
    described = load_yaml(robot, RobotDescription)
    plant, drives = folder / PLANT, folder / DRIVES
    for path in (plant, drives):
        if path.exists():
            raise FileError(f"{path}: exists; name another folder, or remove it")
    try:
        twin = draft_twin(described)
    except NoLinks as error:
        raise FileError(f"{robot}: {error}") from error
    folder.mkdir(parents=True, exist_ok=True)
    plant.write_text(plant_text(twin.file, robot.name), encoding="utf-8")
    drives.write_text(drives_text(twin, robot.name), encoding="utf-8")
    load_plant(str(plant))
    return (
        f"{plant} and {drives}: {described.name} with {len(described.joints)} axes\n"
        f"hil run plan.yaml -o runs/twin --channel {plant} --drives {drives}\n"
        f"hil validate runs/twin --truth {plant}"
    )
