"""Guarded workspace: permitted joint ranges and forbidden boxes.

A workspace belongs to a robot's place of installation, so it is a file of its own. It may narrow
joint ranges, and it lists boxes that no link may enter: table, fence, controller cabinet, operator.
A plan contains its workspace, which is checked again wherever the plan is used.

Boxes are in the robot's base frame, in which the robot file gives gravity, with edges parallel to
its axes. A rotated obstacle takes several boxes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field, field_validator, model_validator

from checked_files.yaml_file import FileModel
from hil.model.robot_file import Point

if TYPE_CHECKING:
    from typing import Self

    from hil.model.robot import Robot


class Box(FileModel):
    """Box closed to the links, from corner `low` to corner `high` [m].

    Attributes
    ----------
    ignore_links : tuple of int
        Links (from 1) not checked against the box, such as a column fixed to the floor.
    """

    name: Annotated[str, Field(min_length=1)]
    low: Point
    high: Point
    ignore_links: tuple[Annotated[int, Field(ge=1)], ...] = ()

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        for axis, low, high in zip("xyz", self.low, self.high, strict=True):
            if not low < high:
                raise ValueError(f"low {axis} = {low:g} m must be below high {axis} = {high:g} m")
        return self


class Workspace(FileModel):
    """Joint ranges and forbidden boxes at a robot's place of installation.

    Attributes
    ----------
    margin : float
        Minimum distance of every link from every box [m]; 5 cm by default.
    ranges : dict
        Joint (from 1) to its lower and upper end [rad or m], within the robot's own range.
    """

    margin: Annotated[float, Field(ge=0, le=1)] = 0.05
    ranges: dict[int, tuple[float, float]] = Field(default_factory=dict)
    boxes: tuple[Box, ...] = ()

    @field_validator("ranges")
    @classmethod
    def _check_ranges(cls, value: dict[int, tuple[float, float]]) -> dict[int, tuple[float, float]]:
        for joint, (low, high) in value.items():
            if not low < high:
                raise ValueError(f"joint {joint}: {low:g} must be below {high:g}; exchange them")
        return value

    @field_validator("boxes")
    @classmethod
    def _names_differ(cls, value: tuple[Box, ...]) -> tuple[Box, ...]:
        names = [box.name for box in value]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"{name} is stated twice; give each box a name of its own")
        return value


def narrow_ranges(robot: Robot, workspace: Workspace | None) -> Robot:
    """Return `robot` with the workspace's joint ranges, for checks only: the digest differs."""
    if workspace is None or not workspace.ranges:
        return robot
    ranges = workspace.ranges.items()
    return robot.replace_joints({k - 1: {"q_min": low, "q_max": high} for k, (low, high) in ranges})
