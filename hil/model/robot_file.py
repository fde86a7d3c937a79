"""Robot file: schema and validation.

One YAML file states the prior knowledge of a robot: its frames in modified Denavit-Hartenberg
notation (Khalil and Kleinfinger 1986), present link parameters and ties by symmetry, the limits of
its joints and its drive trains. SI throughout: rad and N m for revolute joints, m and N for
prismatic ones. A value with a magnitude typical of another unit (degrees, millimetres, kg cm^2) is
refused here, before any planning.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, get_args

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator

from checked_files.names import PlainName
from checked_files.yaml_file import FileModel
from hil.model.drive_train_file import UNKNOWN, CoupledMotor, Drive, Spring, Unknown, positive
from hil.model.polynomial import parse

LinkParameter = Literal["Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "sx", "sy", "sz", "m"]

LINK_PARAMETERS: tuple[LinkParameter, ...] = get_args(LinkParameter)
"""Parameters of a link in the order of eq. (4): inertia about the origin, first moment, mass."""

MOST_JOINTS = 30
"""Maximum number of joints; the cost of the equations grows with the cube."""
EARTH = (0.0, 0.0, -9.81)
"""Gravity at an upright base [m/s^2]."""
MAX_RANGE = {"revolute": 20.0, "prismatic": 20.0}
"""Maximum position by joint type [rad or m]."""
MAX_VELOCITY = {"revolute": 40.0, "prismatic": 20.0}
"""Maximum speed by joint type [rad/s or m/s]."""
MAX_TORQUE = 1e5
"""Maximum torque or force of a joint [N m or N]."""
_MAX_ACCELERATION = {"revolute": 1000.0, "prismatic": 500.0}
_MAX_GEAR_RATIO = {"revolute": 1e4, "prismatic": 1e5}
_UNIT = {"revolute": "rad", "prismatic": "m"}
_WRONG_UNIT = {"revolute": "degrees", "prismatic": "millimetres"}


class Joint(FileModel):
    """Joint with attached link, limits and drive train.

    Attributes
    ----------
    name : str, optional
        Name as in the URDF, for the reader; not part of the robot's digest.
    type : {"revolute", "prismatic"}
        Type of q: an angle [rad] or a displacement [m].
    parent : int, optional
        Joint that carries this one, from 1, or 0 for the base; by default the joint before.
    parameters : tuple of str
        Link parameters present in the model, by default all ten; the others are zero or negligible.
    q_min, q_max : float
        Range of the joint [rad or m].
    velocity_limit, acceleration_limit, torque_limit : float
        Greatest magnitudes [rad/s, rad/s^2, N m, or m/s, m/s^2, N]; an unknown limit prevents any
        motion.
    capsule : Capsule, optional
        Shape of the link, for keeping clear of forbidden boxes (`hil.model.capsules`).
    torque_noise : float, optional
        Standard deviation of a sample of the torque, for predictions [N m, or N].
    friction_wander : float, optional
        Standard deviation of the change of friction within a minute, for predictions [N m, or N].
    """

    name: str | None = None
    type: Literal["revolute", "prismatic"] = "revolute"
    parent: int | None = None
    frame: Frame
    parameters: tuple[LinkParameter, ...] = LINK_PARAMETERS
    q_min: float
    q_max: float
    velocity_limit: float | Unknown
    acceleration_limit: float | Unknown
    torque_limit: float | Unknown
    drive: Drive | None = None
    capsule: Capsule | None = None
    torque_noise: float | None = None
    friction_wander: float | None = None

    @field_validator("parameters")
    @classmethod
    def _check_parameters(cls, value: tuple[LinkParameter, ...]) -> tuple[LinkParameter, ...]:
        twice = [name for name in LINK_PARAMETERS if value.count(name) > 1]
        if twice:
            raise ValueError(f"{twice[0]} is stated twice; remove one")
        return tuple(name for name in LINK_PARAMETERS if name in value)

    @field_validator("q_min", "q_max")
    @classmethod
    def _check_range(cls, value: float, info: ValidationInfo) -> float:
        kind = info.data.get("type", "revolute")
        unit, bound = _UNIT[kind], MAX_RANGE[kind]
        if abs(value) > bound:
            turns = (
                f' (an axis of many turns: type="continuous" in a URDF, else +-{2 * math.tau:.3f})'
            )
            raise ValueError(
                f"{value:g} {unit} must be within +-{bound:g} {unit}:"
                f" it looks like {_WRONG_UNIT[kind]}{_conversion(kind, value)}"
                f"{turns if kind == 'revolute' else ''}"
            )
        lower = info.data.get("q_min", -math.inf)
        if info.field_name == "q_max" and not value > lower:
            raise ValueError(f"{value:g} {unit} must be greater than q_min = {lower:g} {unit}")
        return value

    @field_validator("velocity_limit", "acceleration_limit", "torque_limit")
    @classmethod
    def _check_limit(cls, value: float | Unknown, info: ValidationInfo) -> float | Unknown:
        if value == UNKNOWN:
            return value
        kind = info.data.get("type", "revolute")
        hint = f"it looks like {_WRONG_UNIT[kind]}{_conversion(kind, value)}"
        if info.field_name == "velocity_limit":
            return positive(value, f"{_UNIT[kind]}/s", MAX_VELOCITY[kind], hint)
        if info.field_name == "acceleration_limit":
            return positive(value, f"{_UNIT[kind]}/s2", _MAX_ACCELERATION[kind], hint)
        unit = "N m" if kind == "revolute" else "N"
        return positive(value, unit, MAX_TORQUE, f"it looks like m{unit}")

    @field_validator("torque_noise", "friction_wander")
    @classmethod
    def _check_noise(cls, value: float | None, info: ValidationInfo) -> float | None:
        stated = info.data.get("torque_limit", UNKNOWN)
        bound = math.inf if stated == UNKNOWN else stated
        if value is not None and not 0 < value < bound:
            raise ValueError(
                f"{value:g} must be positive and below torque_limit = {bound:g}; omit the key if "
                "unknown"
            )
        return value

    @field_validator("drive")
    @classmethod
    def _check_gear_ratio(cls, value: Drive | None, info: ValidationInfo) -> Drive | None:
        if value is None or value.gear_ratio == UNKNOWN:
            return value
        bound = _MAX_GEAR_RATIO[info.data.get("type", "revolute")]
        if value.gear_ratio > bound:
            raise ValueError(f"gear_ratio {value.gear_ratio:g} must be at most {bound:g}")
        return value


def _conversion(kind: str, value: float) -> str:
    si = math.radians(value) if kind == "revolute" else value / 1000
    return f"; write {si:.4g}"


class RobotFile(FileModel):
    """Robot file; `hil.model.robot.Robot.load` checks names across the file.

    Attributes
    ----------
    gravity : tuple of three floats
        Gravity in the base frame [m/s^2].
    lengths : dict
        Named lengths for the frames [m].
    ties : tuple of str
        ``Iyy6 = Ixx6``: the left parameter has the right one's value.
    couplings : tuple of CoupledMotor, optional
    springs : tuple of Spring, optional
    """

    name: PlainName
    gravity: tuple[float, float, float]
    lengths: dict[str, float] = Field(default_factory=dict)
    joints: Annotated[tuple[Joint, ...], Field(min_length=1, max_length=MOST_JOINTS)]
    ties: tuple[str, ...] = ()
    couplings: tuple[CoupledMotor, ...] | None = None
    springs: tuple[Spring, ...] | None = None

    @field_validator("gravity")
    @classmethod
    def _check_gravity(cls, value: tuple[float, float, float]) -> tuple[float, float, float]:
        magnitude = math.hypot(*value)
        if magnitude > 30:
            raise ValueError(f"{magnitude:g} m/s2 must be at most 30 m/s2: 9.81 on Earth")
        return value

    @field_validator("lengths")
    @classmethod
    def _check_lengths(cls, value: dict[str, float]) -> dict[str, float]:
        reserved = {"pi"} | {f"{p}{k}" for p in LINK_PARAMETERS for k in range(1, 100)}
        for name, length in value.items():
            if not (name.isidentifier() and name.isascii()) or name in reserved:
                raise ValueError(f"{name!r} cannot name a length; write l1, or wrist_offset")
            positive(length, "m", 20.0, f"{name} looks like millimetres")
        return value


def split_tie(tie: str) -> tuple[str, str]:
    """Split a tie into the tied parameter and the parameter with equal value."""
    tied, value = tie.split("=")
    return tied.strip(), value.strip()


def _expression(value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError(f"{value!r} must be a number or an expression in lengths, such as l1")  # noqa: TRY004 - pydantic expects ValueError
    offset = parse(str(value)).terms.get((), 0.0)
    if not abs(offset) <= 20.0:
        raise ValueError(f"{offset:g} m must be within +-20 m: it looks like millimetres")
    return str(value)


def _angle(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError(f"{value!r} must be an angle in rad, such as -pi/2")  # noqa: TRY004 - as above
    angle = parse(str(value))
    if angle.names:
        raise ValueError(f"{value!r} must be an angle in rad: a number or a multiple of pi")
    radians = angle.evaluate({})
    if not abs(radians) <= 2 * math.pi + 1e-9:
        raise ValueError(
            f"{radians:g} rad must be within +-2 pi: it looks like degrees; write"
            f" {math.radians(radians):.6g}, or pi/2 for 90 degrees"
        )
    # refuse 1.57 for pi/2, since base parameters differ for nearly perpendicular frames
    quarters = round(radians / (math.pi / 2))
    exact = quarters * math.pi / 2
    if quarters and any(round(exact, digits) == radians for digits in range(2, 9)):
        raise ValueError(f"{radians:g} rad is a rounded {quarters} pi/2; write {quarters}*pi/2")
    return radians


Expression = Annotated[str, BeforeValidator(_expression)]
Angle = Annotated[float, BeforeValidator(_angle)]


class Frame(FileModel):
    """Frame j in the parent's: rotation alpha, shift d about x; rotation theta, shift r about z.

    ``q`` adds to theta of a revolute joint, to r of a prismatic one. Further children of a link
    start with rotation gamma and shift b about the parent's z.
    """

    gamma: Angle | None = None
    b: Expression | None = None
    alpha: Angle
    d: Expression = "0"
    theta: Angle = 0.0
    r: Expression = "0"


Point = tuple[float, float, float]


class Capsule(FileModel):
    """Shape of a link: points within `radius` of the segment between `ends` [m].

    The ends are in the link's own frame; both may be the same point.
    """

    ends: tuple[Point, Point]
    radius: float

    @field_validator("ends")
    @classmethod
    def _check_ends(cls, value: tuple[Point, Point]) -> tuple[Point, Point]:
        farthest = max(abs(x) for end in value for x in end)
        if farthest > 20:
            raise ValueError(f"{farthest:g} m must be within +-20 m: it looks like millimetres")
        return value

    @field_validator("radius")
    @classmethod
    def _check_radius(cls, value: float) -> float:
        return positive(value, "m", 5.0, "it looks like millimetres")
