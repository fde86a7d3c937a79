"""The truth about the virtual plant, for whoever sets an estimate against it afterwards.

Only `hil compare` and benchmarks come here; nothing that measures or estimates does. Of the plant
file just the machine is read: whether it is the robot's (`hil.study.other_machine`), and its
bodies, link parameters and payload, put together as the robot's standard parameters of eq. (5), and
from these the base parameters that an identification should find.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import ConfigDict, Field

from checked_files.near import did_you_mean
from checked_files.yaml_file import FileError, FileModel, load_yaml
from hil.errors import UnknownName
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import influences
from hil.model.robot_file import LINK_PARAMETERS
from hil.study.other_machine import refuse_other_machine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot

    Array = NDArray[np.float64]

_TOLERANCE = 1e-9
_PLANT, _PLANT_FILES = "sim_plant", "plants"


class _Part(FileModel):
    """Part of a plant file; what is of no concern here may be there."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class _Body(_Part):
    m: float = 0.0
    sx: float = 0.0
    sy: float = 0.0
    sz: float = 0.0
    Ixx: float = 0.0
    Ixy: float = 0.0
    Ixz: float = 0.0
    Iyy: float = 0.0
    Iyz: float = 0.0
    Izz: float = 0.0

    def standard(self) -> Array:
        """The ten parameters in the order of eq. (4)."""
        return np.array([getattr(self, name) for name in LINK_PARAMETERS])


class _Payload(_Part):
    mass: float
    centre: tuple[float, float, float]
    Ixx: float = 0.0
    Iyy: float = 0.0
    Izz: float = 0.0

    def body(self) -> _Body:
        """The load about the origin of the last link's frame (Huygens and Steiner)."""
        m, (x, y, z) = self.mass, self.centre
        return _Body(
            m=m, sx=m * x, sy=m * y, sz=m * z,
            Ixx=self.Ixx + m * (y * y + z * z), Ixy=-m * x * y,
            Iyy=self.Iyy + m * (x * x + z * z), Ixz=-m * x * z,
            Izz=self.Izz + m * (x * x + y * y), Iyz=-m * y * z,
        )  # fmt: skip


class _Frame(_Part):
    alpha_deg: float = 0.0
    d: float = 0.0
    theta_deg: float = 0.0
    r: float = 0.0


class _Drive(_Part):
    gear_ratio: float
    rotor_inertia: float


class PlantAxis(_Part):
    """A joint of the plant: where it is, what it carries and what drives it."""

    joint: Literal["revolute", "prismatic"] = "revolute"
    frame: _Frame = _Frame()
    link: _Body
    drive: _Drive


class Plant(_Part):
    """A plant file, as far as it is of concern here."""

    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    axes: tuple[PlantAxis, ...] = Field(min_length=1)
    payload: _Payload | None = None

    def standard(self) -> Array:
        """Standard parameters of all links, the payload part of the last."""
        found = np.concatenate([axis.link.standard() for axis in self.axes])
        if self.payload is not None:
            found[-len(LINK_PARAMETERS) :] += self.payload.body().standard()
        return found

    def drives(self, robot: Robot) -> Array:
        """Motor inertias that the robot leaves unknown; there are no coupled motors and springs."""
        inertias = [axis.drive.rotor_inertia * axis.drive.gear_ratio**2 for axis in self.axes]
        unknown = np.array(inertias)[robot.rotor_inertia_unknown]
        return np.append(unknown, np.zeros(len(robot.added_parameters) - len(unknown)))


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
        known = [each.stem for each in _packaged()]
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


def find_plant(plant: Path | str) -> Path:
    """Path of a plant file; the package of the plant is located, never imported."""
    return next((path for path in _packaged() if path.stem == str(plant)), Path(plant))


def _packaged() -> list[Path]:
    spec = find_spec(_PLANT)
    folders = [] if spec is None else list(spec.submodule_search_locations or [])
    return sorted(path for each in folders for path in Path(each, _PLANT_FILES).glob("*.yaml"))


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
