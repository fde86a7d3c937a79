"""What a robot file may say of a link's frame and of its shape."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import BeforeValidator, field_validator

from checked_files.yaml_file import FileModel
from hil.model.drive_train_file import positive
from hil.model.polynomial import parse


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
    _refuse_rounded_right_angle(radians)
    return radians


def _refuse_rounded_right_angle(radians: float) -> None:
    """Refuse 1.57 for pi/2: a frame that is nearly square has other base parameters."""
    quarters = round(radians / (math.pi / 2))
    exact = quarters * math.pi / 2
    if quarters and any(round(exact, digits) == radians for digits in range(2, 9)):
        raise ValueError(f"{radians:g} rad is a rounded {quarters} pi/2; write {quarters}*pi/2")


Expression = Annotated[str, BeforeValidator(_expression)]
Angle = Annotated[float, BeforeValidator(_angle)]


class Frame(FileModel):
    """Frame j in frame j-1: turn by alpha and shift by d about x, by theta and r about z.

    ``q`` adds to theta of a revolute joint, to r of a prismatic one.
    """

    alpha: Angle
    d: Expression = "0"
    theta: Angle = 0.0
    r: Expression = "0"


Point = tuple[float, float, float]


class Capsule(FileModel):
    """Shape of a link: all points within `radius` of the segment between `ends` [m].

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
