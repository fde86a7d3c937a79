"""True base parameters of a virtual plant, for comparison with an estimate.

Only `hil validate --truth` and benchmarks use this module; no measurement or estimation does. The
run must have been measured on the plant named in its journal. The plant file yields frames, bodies,
drives and payload. Joint types, frames, gravity and gear ratios must be those of the robot, since
base parameters would otherwise be combinations of other bodies. The standard parameters of eq. (5),
links and payload together, then give the true base parameters.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import ConfigDict, Field

from checked_files.near import did_you_mean
from checked_files.yaml_file import FileError, FileModel, load_yaml, read_text, refuse
from hil.errors import Mismatch, UnknownName
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import influences
from hil.model.frames import ROUNDED_OFF
from hil.model.robot_file import EARTH, LINK_PARAMETERS
from hil.runs.journal import BusName

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.runs.run import Run

    Place = tuple[str | int, ...]

_PLANT, _PLANT_FILES = "sim_plant", "plants"


class _Part(FileModel):
    """Part of a plant file; other keys are ignored."""

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
        """Ten standard parameters in the order of eq. (4)."""
        return np.array([getattr(self, name) for name in LINK_PARAMETERS])


class _Payload(_Part):
    mass: float
    centre: tuple[float, float, float]
    Ixx: float = 0.0
    Iyy: float = 0.0
    Izz: float = 0.0

    def body(self) -> _Body:
        """Inertia of the load about the origin of the last link's frame (Huygens and Steiner)."""
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
    """Joint of the plant: frame, body and drive."""

    joint: Literal["revolute", "prismatic"] = "revolute"
    frame: _Frame = _Frame()
    link: _Body
    drive: _Drive


class Plant(_Part):
    """Machine of a plant file."""

    gravity: tuple[float, float, float] = EARTH
    axes: tuple[PlantAxis, ...] = Field(min_length=1)
    payload: _Payload | None = None

    def standard(self) -> Array:
        """Standard parameters of all links; the last link includes the payload."""
        found = np.concatenate([axis.link.standard() for axis in self.axes])
        if self.payload is not None:
            found[-len(LINK_PARAMETERS) :] += self.payload.body().standard()
        return found

    def drives(self, robot: Robot) -> Array:
        """Return motor inertias unknown to the robot; plants have no coupled motors or springs."""
        inertias = [axis.drive.rotor_inertia * axis.drive.gear_ratio**2 for axis in self.axes]
        unknown = np.array(inertias)[robot.rotor_inertia_unknown]
        return np.append(unknown, np.zeros(len(robot.added_parameters) - len(unknown)))


def find_plant(plant: Path | str) -> Path:
    """Return the path of a plant file, without an import of the plant's package."""
    return next((path for path in packaged_plants() if path.stem == str(plant)), Path(plant))


def packaged_plants() -> list[Path]:
    """Return the paths of the built-in plant files."""
    spec = find_spec(_PLANT)
    folders = [] if spec is None else list(spec.submodule_search_locations or [])
    return sorted(path for each in folders for path in Path(each, _PLANT_FILES).glob("*.yaml"))


_REMEDY = "parameters of another machine cannot be compared"


def true_parameters(robot: Robot, plant: Path | str) -> Array:
    """Compute the true base parameters of a virtual plant.

    Parameters
    ----------
    robot : Robot
        Identified robot.
    plant : path or str
        Plant file, or name of a built-in plant.

    Returns
    -------
    ndarray, shape (n_base,)
        ``K @ standard``, K being `BaseParameters.matrix`.

    Raises
    ------
    FileError
        Another machine, or a plant with torques that no base parameters of `robot` describe.
    UnknownName
        Neither a file nor a built-in plant.
    """
    path = find_plant(plant)
    if not path.exists():
        known = [each.stem for each in packaged_plants()]
        raise UnknownName(
            f"{plant}: neither a plant file nor a packaged "
            f"plant{did_you_mean(str(plant), known)}; available: {', '.join(known) or 'none'}"
        )
    content = load_yaml(path, Plant)
    refuse(str(path), read_text(path), _differences(robot, content))
    standard = np.append(content.standard(), content.drives(robot))
    p: Array = base_parameters(robot).matrix @ standard
    # refuse links with observable parameters that the robot file states as absent or tied
    mass, gravity = influences(robot)
    rows = np.vstack([mass.reshape(-1, standard.size), gravity.reshape(-1, standard.size)])
    true = rows @ standard
    missed = np.abs(true - rows @ base_parameters(robot).placement @ p).max()
    if missed > ROUNDED_OFF * np.abs(true).max():
        names = robot.standard_parameters
        absent = [n for n, v in zip(names, standard, strict=True) if v and n not in robot.present]
        fault = "ties parameters that differ in the plant; remove the tie"
        if absent:
            fault = f"lacks parameters of the plant: {', '.join(absent)}; add them"
        raise FileError(f"{path}: the file of {robot.name} {fault} and plan anew")
    return p


def _differences(robot: Robot, plant: Plant) -> Iterator[tuple[Place, str]]:
    if len(plant.axes) != robot.n_joints:
        yield (
            ("axes",),
            f"{len(plant.axes)} axes must be {robot.n_joints}, as {robot.name} has; give the file"
            " of the plant that was measured",
        )
        return
    if not robot.is_chain:
        yield (("axes",), "are a chain, and the robot is a tree; virtual plants have no branches")
        return
    if not np.allclose(plant.gravity, robot.gravity, atol=ROUNDED_OFF, rtol=0):
        yield (
            ("gravity",),
            f"{_listed(plant.gravity)} m/s2 must be {_listed(robot.gravity)} m/s2, as in the "
            f"robot file; {_REMEDY}",
        )
    for k, axis in enumerate(plant.axes):
        yield from _axis_differences(robot, k, axis)


def _axis_differences(robot: Robot, k: int, axis: PlantAxis) -> Iterator[tuple[Place, str]]:
    joint = "revolute" if robot.revolute[k] else "prismatic"
    if axis.joint != joint:
        yield (
            ("axes", k, "joint"),
            f"{axis.joint} must be {joint}, as in the robot file; {_REMEDY}",
        )
    frame = axis.frame
    there = (np.radians(frame.alpha_deg), frame.d, np.radians(frame.theta_deg), frame.r)
    stated = (robot.alpha[k], robot.d[k], robot.theta[k], robot.r[k])
    if not np.allclose(there, stated, atol=ROUNDED_OFF, rtol=0):
        yield (
            ("axes", k, "frame"),
            f"alpha, d, theta, r = {_listed(there)} must be {_listed(stated)}, as in the robot "
            "file; parameters of other frames cannot be compared",
        )
    gear, known = axis.drive.gear_ratio, float(robot.gear_ratio[k])
    # 1e-6: relative rounding error of digits in a file; an unknown gear ratio (NaN) is not reported
    if abs(gear - known) > 1e-6 * known:
        yield (
            ("axes", k, "drive", "gear_ratio"),
            f"{gear:g} must be {known:g}, as in the robot file: with another gear every position "
            "and torque is scaled",
        )


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)


def refuse_other_plant(run: Run, truth: Path | str) -> None:
    """Refuse a run that was not measured on the plant of `truth`.

    If the plant file named in the journal is missing, `truth` is trusted.

    Raises
    ------
    FileError
        An unusable plant file.
    Mismatch
        The run was measured on a real machine, or on a plant with other bodies or drives.
    """
    sessions = run.journal.sessions
    if not run.journal.simulated:
        bus = sessions[-1].bus if sessions else "nothing"
        raise Mismatch(
            f"{run.path}: was measured on {bus}; only on the virtual plant is the truth known."
            " Judge this run by its report's intervals and residuals"
        )
    given = load_yaml(find_plant(truth), Plant)
    for channel in sorted({BusName.read(session.bus).channel for session in sessions}):
        measured = find_plant(channel)
        if measured.is_file() and load_yaml(measured, Plant) != given:
            raise Mismatch(
                f"{run.path}: was measured on the plant {channel}, which has other bodies or drives"
                f" than {truth}; compare with --truth {channel}"
            )
