"""Plant file: the true parameters of a virtual machine.

The file holds everything that the simulation needs and an identification is to find: link
parameters, drives, friction, noise, seed. It is read by the plant and by comparisons of an estimate
with the truth, never for measuring or estimating.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from checked_files.yaml_file import FileError, FileModel, load_yaml

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Self

    from numpy.typing import NDArray

PLANTS = Path(__file__).with_name("plants")
"""Folder of the packaged plants."""

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Frame(FileModel):
    """Modified Denavit-Hartenberg frame of a joint; q adds to theta, or to r if prismatic."""

    alpha_deg: float = 0.0
    d: float = 0.0
    theta_deg: float = 0.0
    r: float = 0.0


class Body(FileModel):
    """Mass [kg], first moment [kg m] and inertia about the frame's origin [kg m^2]."""

    m: float = 0.0
    sx: float = 0.0
    sy: float = 0.0
    sz: float = 0.0
    Ixx: float = 0.0
    Iyy: float = 0.0
    Izz: float = 0.0
    Ixy: float = 0.0
    Ixz: float = 0.0
    Iyz: float = 0.0

    def row(self) -> NDArray[np.float64]:
        """Return the body as a row of the compiled dynamics, shape (10,)."""
        return np.array([getattr(self, key) for key in type(self).model_fields])


class Payload(FileModel):
    """Payload on the last link: mass, centre of mass and inertia about the centre of mass.

    With `gives` the payload is loose: its centre sags by this distance along gravity [m].
    """

    mass: NotNegative
    centre: tuple[float, float, float]
    Ixx: NotNegative = 0.0
    Iyy: NotNegative = 0.0
    Izz: NotNegative = 0.0
    gives: NotNegative = 0.0

    def body(self) -> Body:
        """Return the load as a part of the last link, about the link's origin."""
        (x, y, z), m = self.centre, self.mass
        return Body(
            m=m,
            sx=m * x,
            sy=m * y,
            sz=m * z,
            Ixx=self.Ixx + m * (y * y + z * z),
            Iyy=self.Iyy + m * (x * x + z * z),
            Izz=self.Izz + m * (x * x + y * y),
            Ixy=-m * x * y,
            Ixz=-m * x * z,
            Iyz=-m * y * z,
        )


class Drive(FileModel):
    """Motor, gear, encoder, power stage and loops of an axis.

    Joint side is rad and N m, or m and N for a prismatic joint.
    """

    node: Annotated[int, Field(ge=1, le=127)]
    axis: Annotated[int, Field(ge=1, le=8)] = 1
    """Number of the axis in its node; objects are 800h apart."""
    gear_ratio: Positive
    """Motor angle over joint coordinate [-, or rad/m]."""
    rotor_inertia: NotNegative
    """Rotor inertia, motor side [kg m^2]; 0 for a direct drive with the rotor in the link."""
    torque_constant: Positive
    """Torque constant [N m/A, peak amplitude]."""
    rated_torque_mNm: Annotated[int, Field(gt=0)]
    rated_current_mA: Annotated[int, Field(gt=0)]
    peak_torque: Positive
    """Peak torque at the joint [N m or N]."""
    increments: Annotated[int, Field(gt=0)] = 4096
    direction: Literal[-1, 1] = 1
    zero: int = 0
    """Increments at q = 0."""
    velocity_max: Positive
    acceleration_max: Positive
    range_deg: Positive | None = None
    """Range of travel, +- this angle [deg]; alternative to `range`."""
    range: tuple[float, float] | None = None
    """Range of travel [rad or m]."""
    load_inertia: Positive
    """Arm inertia used for tuning the velocity loop [kg m^2, or kg]."""
    stiffness: Positive | None = None
    """Stiffness of the gear with the motor held [N m/rad]; rigid if left out."""
    backlash: NotNegative = 0.0
    """Backlash of a soft gear, at the joint [rad]."""
    current_lag: Annotated[float, Field(ge=0, le=0.02)] = 0.0
    """Age of the current reading [s]."""
    personality: str | None = None
    """Personality of the drive: name of a packaged one, or path of a file."""

    @model_validator(mode="after")
    def _backlash_has_a_gear(self) -> Self:
        if self.backlash and self.stiffness is None:
            raise ValueError(f"backlash {self.backlash:g} rad needs a stiffness too")
        if self.stiffness is not None and not self.rotor_inertia:
            raise ValueError(
                f"stiffness {self.stiffness:g} needs a rotor: its rotor_inertia must be positive"
            )
        return self

    @model_validator(mode="after")
    def _one_range(self) -> Self:
        if (self.range_deg is None) == (self.range is None):
            raise ValueError("needs either range_deg or range")
        low, high = self.reach
        if low >= high:
            raise ValueError(f"range: {low:g} must be below {high:g}; exchange them")
        return self

    @property
    def reach(self) -> tuple[float, float]:
        """Ends of the axis's range of travel [rad or m]."""
        if self.range is not None:
            return self.range
        end = math.radians(self.range_deg or 0.0)
        return -end, end

    @property
    def motor_inertia(self) -> float:
        """Rotor inertia at the joint [kg m^2, or kg]."""
        return self.rotor_inertia * self.gear_ratio**2


class Loops(FileModel):
    """Bandwidths of the cascade."""

    position: Positive = 25.0
    """Bandwidth of the position loop [1/s]."""
    velocity: Positive = 120.0
    """Bandwidth of the velocity loop [1/s]."""
    integral: Positive = 20.0
    """Bandwidth of the integral part [1/s]."""


class Friction(FileModel):
    """Friction of an axis; see `sim_plant.physics.friction`."""

    creep: NotNegative
    """Friction at creep speed [N m or N]."""
    full_speed: NotNegative
    """Friction at the speed limit [N m or N]."""
    heat_time: Positive
    """Time constant of the temperature [s]."""
    asymmetry: float = 0.0
    """Relative excess in the positive direction."""
    load: NotNegative = 0.0
    """Friction per transmitted torque."""
    temperature: float = 5.0
    """Temperature rise at power-on of the machine [K]."""
    lubricant: Annotated[float, Field(ge=0, le=1)] = 1.0
    """Settled share of the lubricant at power-on of the machine."""
    presliding: Positive = 3e-4
    """Presliding distance [rad or m]."""


class PlantAxis(FileModel):
    """Joint of the arm with its link."""

    name: str
    joint: Literal["revolute", "prismatic"] = "revolute"
    frame: Frame
    link: Body
    drive: Drive
    friction: Friction
    position_deg: float = 0.0
    """Position at power-on of the machine [deg]; alternative to `position`."""
    position: float | None = None
    """Position at power-on of the machine [rad or m]."""

    @model_validator(mode="after")
    def _no_degrees_of_a_way(self) -> Self:
        if self.joint == "prismatic" and (self.drive.range_deg or self.position_deg):
            raise ValueError(
                f"{self.name} is prismatic: state drive.range and position [m], not range_deg "
                "and position_deg"
            )
        return self

    @property
    def start(self) -> float:
        """Position at power-on of the machine [rad or m]."""
        return math.radians(self.position_deg) if self.position is None else self.position


class OtherRipple(FileModel):
    """Torque ripple of an order in addition to the usual orders of the motors."""

    order: Annotated[float, Field(gt=0, le=60)]
    """Periods per revolution of the motor."""
    amplitude: NotNegative
    """Share of peak torque."""


class Noise(FileModel):
    """Noise of the current sensor and torque ripple of the motor."""

    torque: NotNegative = 0.0025
    """White noise per sample, as a share of peak torque."""
    ripple: NotNegative = 0.003
    """Ripple of orders 1, 2 and 6, as a share of peak torque."""
    other_ripple: OtherRipple | None = None


class PlantFile(FileModel):
    """Virtual machine."""

    name: str
    seed: int = 1
    step: Annotated[float, Field(gt=0, le=0.001)] = 0.001
    """Period of the control loops and step of the physics [s]."""
    drift: bool = True
    """Enable friction drift; otherwise friction keeps its initial state."""
    drift_strength: Positive = 1.0
    """Scale of the effects of temperature, lubricant and chance on friction."""
    symmetric: bool = False
    """Disregard the friction asymmetry of all axes."""
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    loops: Loops = Loops()
    noise: Noise = Noise()
    payload: Payload | None = None
    axes: Annotated[tuple[PlantAxis, ...], Field(min_length=1)]

    @field_validator("axes")
    @classmethod
    def _nodes_differ(cls, axes: tuple[PlantAxis, ...]) -> tuple[PlantAxis, ...]:
        by_node: dict[int, list[int]] = {}
        for axis in axes:
            by_node.setdefault(axis.drive.node, []).append(axis.drive.axis)
        for node, own in by_node.items():
            if len(set(own)) < len(own):
                raise ValueError(
                    f"nodes {[axis.drive.node for axis in axes]} must differ; if node {node} has "
                    f"several axes, number them: axis is {own}"
                )
            if sorted(own) != list(range(1, len(own) + 1)):
                raise ValueError(f"node {node}: axis is {own}; number them from 1 without a gap")
        return axes

    def bodies(self) -> list[Body]:
        """Return the links of the arm, including the payload."""
        bodies = [axis.link for axis in self.axes]
        if self.payload is not None:
            load = self.payload.body()
            last = bodies[-1]
            bodies[-1] = Body(
                **{key: getattr(last, key) + getattr(load, key) for key in Body.model_fields}
            )
        return bodies


def packaged_plants() -> Sequence[str]:
    """Return the names of the packaged plants."""
    return sorted(path.stem for path in PLANTS.glob("*.yaml"))


def plant_path(name_or_path: str) -> Path:
    """Return the path of a packaged plant's file, or the given path."""
    packaged = PLANTS / f"{name_or_path}.yaml"
    return packaged if packaged.is_file() else Path(name_or_path)


def load_plant_file(name_or_path: str) -> PlantFile:
    """Read a packaged plant by name, or a plant file by path.

    Raises
    ------
    FileError
        No such plant, or a file that does not fit.
    """
    path = plant_path(name_or_path)
    if not path.is_file():
        known = ", ".join(packaged_plants())
        raise FileError(
            f"{name_or_path}: neither a packaged plant ({known}) nor the path of a plant file"
        )
    return load_yaml(path, PlantFile)
