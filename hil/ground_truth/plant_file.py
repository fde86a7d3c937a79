"""A plant file, as far as the truth needs it: frames, bodies, drives, payload of the machine.

Link parameters and payload together are the robot's standard parameters of eq. (5).
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import ConfigDict, Field

from checked_files.yaml_file import FileModel
from hil.model.robot_file import EARTH, LINK_PARAMETERS

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.model.robot import Robot


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

    gravity: tuple[float, float, float] = EARTH
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


def find_plant(plant: Path | str) -> Path:
    """Path of a plant file; the package of the plant is located, never imported."""
    return next((path for path in packaged_plants() if path.stem == str(plant)), Path(plant))


def packaged_plants() -> list[Path]:
    """Paths of the plant files that come along."""
    spec = find_spec(_PLANT)
    folders = [] if spec is None else list(spec.submodule_search_locations or [])
    return sorted(path for each in folders for path in Path(each, _PLANT_FILES).glob("*.yaml"))
