"""What a twin needs of a robot file: frames, ranges, limits, drive trains, present parameters.

The plant shares no program with the identification, so it reads the file for itself; what it does
not need may stand there. A file that `hil robot` refuses may be read here, none that it takes is
refused.
"""

from __future__ import annotations

import ast
import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, ConfigDict, Field, ValidationInfo, field_validator

from checked_files.yaml_file import FileModel

LINK_PARAMETERS = ("m", "sx", "sy", "sz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")

Positive = Annotated[float, Field(gt=0)]


class _Part(FileModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class RobotFrame(_Part):
    """Modified Denavit-Hartenberg frame, as expressions in pi and named lengths."""

    alpha: Annotated[str, BeforeValidator(str)]
    d: Annotated[str, BeforeValidator(str)] = "0"
    theta: Annotated[str, BeforeValidator(str)] = "0"
    r: Annotated[str, BeforeValidator(str)] = "0"


class RobotDrive(_Part):
    """Drive train of a joint."""

    gear_ratio: Positive
    rotor_inertia: Annotated[float, Field(ge=0)]
    torque_constant: Positive


class RobotJoint(_Part):
    """A joint and the link that it carries."""

    type: Literal["revolute", "prismatic"] = "revolute"
    frame: RobotFrame
    parameters: tuple[str, ...] = LINK_PARAMETERS
    q_min: float
    q_max: float
    velocity_limit: Positive
    acceleration_limit: Positive
    torque_limit: Positive
    drive: RobotDrive

    @field_validator("q_max")
    @classmethod
    def _above(cls, value: float, info: ValidationInfo) -> float:
        low = info.data.get("q_min", -math.inf)
        if not value > low:
            raise ValueError(f"{value:g} must be greater than q_min = {low:g}")
        return value


class RobotDescription(_Part):
    """A robot file."""

    name: str
    gravity: tuple[float, float, float]
    lengths: dict[str, float] = Field(default_factory=dict)
    joints: Annotated[tuple[RobotJoint, ...], Field(min_length=1)]
    ties: tuple[str, ...] = ()

    @field_validator("joints")
    @classmethod
    def _readable(cls, joints: tuple[RobotJoint, ...], info: ValidationInfo) -> object:
        lengths = info.data.get("lengths", {})
        for number, joint in enumerate(joints, start=1):
            for key, text in joint.frame:
                try:
                    value_of(text, lengths)
                except ValueError as error:
                    raise ValueError(f"frame of joint {number}: {key}: {error}") from error
        return joints

    def frames(self) -> list[tuple[float, float, float, float]]:
        """alpha, d, theta, r of each joint [rad, m, rad, m]."""
        return [
            (
                value_of(joint.frame.alpha, self.lengths),
                value_of(joint.frame.d, self.lengths),
                value_of(joint.frame.theta, self.lengths),
                value_of(joint.frame.r, self.lengths),
            )
            for joint in self.joints
        ]


def value_of(text: str, lengths: dict[str, float]) -> float:
    """Value of an expression in numbers, pi and named lengths.

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
            f"{text[:60]!r} is no sum, product or quotient of numbers, pi and lengths ({known})"
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
