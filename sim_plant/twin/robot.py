"""Data of a robot file for a twin: frames, ranges, limits, drive trains, present parameters.

The plant shares no code with the identification, so it has its own reader. Keys that the plant does
not use are known by name and ignored, so that a mistyped key is refused. A file refused by `hil
robot` may be accepted here, but no file accepted there is refused.
"""

from __future__ import annotations

import ast
import math
import re
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator

from checked_files.yaml_file import FileModel

LINK_PARAMETERS = ("m", "sx", "sy", "sz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")

UNKNOWN = "unknown"
ROTOR = 0.2
"""Share of the torque limit that accelerates an unknown rotor at the acceleration limit."""
_TIE = re.compile(r"^\s*([A-Za-z]+)(\d+)\s*=\s*([A-Za-z]+)(\d+)\s*$")


def _stated(value: object) -> object:
    if value == UNKNOWN:
        raise ValueError("is unknown; state it: needed to move the twin")
    return value


Positive = Annotated[float, BeforeValidator(_stated), Field(gt=0)]


def _refuse_tree(value: object) -> object:
    if value is not None:
        raise ValueError(
            "the virtual plant moves a chain, and the robot is a tree; make a twin of one branch:"
            " hil robot new --urdf FILE --to LINK"
        )
    return value


OfTree = Annotated[None, BeforeValidator(_refuse_tree)]


class RobotFrame(FileModel):
    """Modified Denavit-Hartenberg frame, as expressions in pi and named lengths."""

    alpha: Annotated[str, BeforeValidator(str)]
    d: Annotated[str, BeforeValidator(str)] = "0"
    theta: Annotated[str, BeforeValidator(str)] = "0"
    r: Annotated[str, BeforeValidator(str)] = "0"
    gamma: OfTree = None
    b: OfTree = None


class RobotDrive(FileModel):
    """Drive train of a joint; an unknown rotor is estimated from the limits."""

    gear_ratio: Positive
    rotor_inertia: Annotated[float, Field(ge=0)] | Literal["unknown"]
    torque_constant: Positive
    rotor_inertia_uncertainty: object = None
    torque_constant_uncertainty: object = None
    encoder_resolution: object = None


class RobotJoint(FileModel):
    """Joint with its link."""

    name: str | None = None
    parent: OfTree = None
    type: Literal["revolute", "prismatic"] = "revolute"
    frame: RobotFrame
    parameters: tuple[str, ...] = LINK_PARAMETERS
    q_min: float
    q_max: float
    velocity_limit: Positive
    acceleration_limit: Positive
    torque_limit: Positive
    drive: RobotDrive
    capsule: object = None
    torque_noise: object = None
    friction_wander: object = None

    @field_validator("q_max")
    @classmethod
    def _above(cls, value: float, info: ValidationInfo) -> float:
        low = info.data.get("q_min", -math.inf)
        if not value > low:
            raise ValueError(f"{value:g} must be greater than q_min = {low:g}")
        return value

    @property
    def rotor_inertia(self) -> float:
        """Rotor inertia, motor side [kg m^2]; if unknown, estimated from the torque limit."""
        stated = self.drive.rotor_inertia
        if stated != UNKNOWN:
            return float(stated)
        reflected = ROTOR * self.torque_limit / self.acceleration_limit
        return float(f"{reflected / self.drive.gear_ratio**2:.2g}")

    @property
    def motor_inertia(self) -> float:
        """Rotor inertia at the joint [kg m^2 or kg]."""
        return self.rotor_inertia * self.drive.gear_ratio**2


class RobotDescription(FileModel):
    """Robot file."""

    name: str
    gravity: tuple[float, float, float]
    lengths: dict[str, float] = Field(default_factory=dict)
    joints: Annotated[tuple[RobotJoint, ...], Field(min_length=1)]
    ties: tuple[str, ...] = ()
    couplings: tuple[object, ...] | None = None
    springs: object = None

    @field_validator("couplings")
    @classmethod
    def _none_coupled(cls, couplings: tuple[object, ...] | None) -> tuple[object, ...] | None:
        if couplings:
            raise ValueError("the virtual plant has no coupled motors; remove them for a twin")
        return couplings

    @field_validator("ties")
    @classmethod
    def _ties_named(cls, ties: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        for tie in ties:
            _tied(tie, len(info.data.get("joints", ())))
        return ties

    def tied(self) -> list[tuple[tuple[int, int], tuple[int, int]]]:
        """Return link (from 0) and parameter index of both sides of all ties."""
        return [_tied(tie, len(self.joints)) for tie in self.ties]

    @field_validator("joints")
    @classmethod
    def _readable(cls, joints: tuple[RobotJoint, ...], info: ValidationInfo) -> object:
        lengths = info.data.get("lengths", {})
        for number, joint in enumerate(joints, start=1):
            for key, text in joint.frame:
                try:
                    value_of(text or "0", lengths)
                except ValueError as error:
                    raise ValueError(f"frame of joint {number}: {key}: {error}") from error
        return joints

    def frames(self) -> list[tuple[float, float, float, float]]:
        """Return alpha, d, theta, r of all joints [rad, m, rad, m]."""
        return [
            (
                value_of(joint.frame.alpha, self.lengths),
                value_of(joint.frame.d, self.lengths),
                value_of(joint.frame.theta, self.lengths),
                value_of(joint.frame.r, self.lengths),
            )
            for joint in self.joints
        ]


def _tied(tie: str, n: int) -> tuple[tuple[int, int], tuple[int, int]]:
    parts = _TIE.match(tie)
    names = [] if parts is None else [(parts[1], int(parts[2])), (parts[3], int(parts[4]))]
    if not names or any(name not in LINK_PARAMETERS or not 1 <= k <= n for name, k in names):
        raise ValueError(f"{tie!r} must tie two parameters of links, as in: Iyy6 = Ixx6")
    left, right = ((k - 1, LINK_PARAMETERS.index(name)) for name, k in names)
    return left, right


def value_of(text: str, lengths: dict[str, float]) -> float:
    """Evaluate an expression in numbers, pi and named lengths.

    Raises
    ------
    ValueError
        The text is no such expression.
    """
    try:
        return _value(ast.parse(text.strip(), mode="eval").body, {"pi": math.pi, **lengths})
    except (SyntaxError, ArithmeticError, LookupError, RecursionError, MemoryError):
        known = ", ".join(lengths) or "none"
        raise ValueError(
            f"{text[:60]!r} is not a sum, product or quotient of numbers, pi and lengths ({known})"
        ) from None


def _value(node: ast.expr, names: dict[str, float]) -> float:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return float(value)
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, names)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _value(operand, names)
        case ast.BinOp(left=left, op=operator, right=right):
            return _combined(_value(left, names), operator, _value(right, names))
    raise LookupError


def _combined(left: float, operator: ast.operator, right: float) -> float:
    match operator:
        case ast.Add():
            return left + right
        case ast.Sub():
            return left - right
        case ast.Mult():
            return left * right
        case ast.Div():
            return left / right
    raise LookupError
