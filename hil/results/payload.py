"""A load from two run folders: Table 3 of our robot, and the drives' gains by a known mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.estimation.identify import NotIdentifiable, estimate, prepared_for
from hil.estimation.payload import NoLoad, payload
from hil.estimation.simultaneous import SimultaneousFit
from hil.estimation.torque_constants import drive_gains
from hil.results.model_file import recorded
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from pathlib import Path

    from hil.estimation.estimate import Estimate
    from hil.estimation.payload import Payload
    from hil.estimation.torque_constants import Gains
    from hil.model.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """What two runs tell of a load.

    Attributes
    ----------
    robot : Robot
    before, after : Estimate
        Without and with it.
    payload : Payload
    mass : float or None
        As it was given [kg].
    gains : Gains or None
        Where the mass was given.
    """

    robot: Robot
    before: Estimate
    after: Estimate
    payload: Payload
    mass: float | None
    gains: Gains | None


def find_load(without: Path, loaded: Path, mass: float | None = None) -> Load:
    """Estimate both runs anew and take the load from their difference.

    Parameters
    ----------
    mass : float, optional
        Of the load, if it is known [kg]; the torque constants are then checked by it.

    Raises
    ------
    FileError
        Runs of different robots, or measurements that do not suffice.
    """
    folders = RunFolder.open(without), RunFolder.open(loaded)
    robot = folders[0].robot
    if robot != folders[1].robot:
        raise FileError(f"{loaded}: measured with another robot file than {without}; use the same")
    before, after = (_estimate(folder) for folder in folders)
    try:
        found = payload(robot, before, after)
    except NoLoad as error:
        raise FileError(str(error)) from error
    gains = None
    if mass is not None:
        gains = drive_gains(robot, _joint(folders[0], before), _joint(folders[1], after), mass)
    return Load(robot, before, after, found, mass, gains)


def _estimate(folder: RunFolder) -> Estimate:
    try:
        return estimate(folder.robot, recorded(folder))
    except NotIdentifiable as error:
        raise FileError(f"{folder.path}: {error}") from error


def _joint(folder: RunFolder, found: Estimate) -> SimultaneousFit:
    return SimultaneousFit(folder.robot, prepared_for(found, recorded(folder)))
