"""Whether drives file and robot file describe the same machine.

Both state joint types, gear ratios, torque constants and limits, since each is used without the
other. Where
they contradict each other every torque would be wrong by the same factor, and no residual would
show it. So they are compared before anything moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError, line_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.model.robot import Robot

SAME = 1e-3
"""Gear ratios and torque constants may differ by this share."""
NARROWER = 5e-3
"""Limits of a drive may be narrower than the robot's by this share, never wider."""

_Place = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class StatedAxis:
    """What a drives file states of one axis, joint side, SI.

    `torque_constant` is None where the drive reports torque, not current.
    """

    name: str
    joint: str
    gear_ratio: float
    torque_constant: float | None
    q_min: float
    q_max: float
    velocity: float
    acceleration: float
    torque: float


def refuse_contradictions(axes: Sequence[StatedAxis], robot: Robot, text: str, source: str) -> None:
    """Compare a drives file with a robot.

    Parameters
    ----------
    axes : sequence of StatedAxis
        In joint order.
    text, source : str
        The drives file's text, to find lines in, and its name.

    Raises
    ------
    FileError
        One line for each contradiction.
    """
    if len(axes) != robot.n_joints:
        raise FileError(
            f"{source}:{line_of(text, ('axes',))}: axes: {len(axes)} axes must be"
            f" {robot.n_joints}, one for each joint of {robot.name}"
        )
    problems = [
        (("axes", index, *keys), message)
        for index, axis in enumerate(axes)
        for keys, message in _of_axis(axis, index, robot)
    ]
    if problems:
        raise FileError(
            "\n".join(
                f"{source}:{line_of(text, place)}: {'.'.join(map(str, place))}: {message}"
                for place, message in problems
            )
        )


def _of_axis(axis: StatedAxis, index: int, robot: Robot) -> Iterator[tuple[_Place, str]]:
    """Find contradictions of one axis; of another kind of joint, none but this."""
    joint = "revolute" if robot.revolute[index] else "prismatic"
    if axis.joint != joint:
        yield (
            ("joint",),
            f"{axis.joint} of axis {axis.name} must be {joint} as in the robot file of"
            f" {robot.name}; correct whichever is wrong",
        )
        return
    yield from _factors(axis, index, robot)
    yield from _limits(axis, index, robot)


def _factors(axis: StatedAxis, index: int, robot: Robot) -> Iterator[tuple[_Place, str]]:
    for key, stated, known in (
        ("gear_ratio", axis.gear_ratio, float(robot.gear_ratio[index])),
        ("torque_constant", axis.torque_constant, float(robot.torque_constant[index])),
    ):
        if stated is not None and abs(stated - known) > SAME * abs(known):
            yield (
                (key,),
                f"{stated:g} of axis {axis.name} must be {known:g} as in the robot file of"
                f" {robot.name}; correct whichever is wrong",
            )


def _limits(axis: StatedAxis, index: int, robot: Robot) -> Iterator[tuple[_Place, str]]:
    """Find limits wider than the robot's, and narrower ones that a plan would run into."""
    low, high = float(robot.q_min[index]), float(robot.q_max[index])
    q, tau = robot.position_unit(index), robot.torque_unit(index)
    for key, stated, known, unit in (
        ("q_min", -axis.q_min, -low, q),
        ("q_max", axis.q_max, high, q),
        ("velocity", axis.velocity, float(robot.velocity_limit[index]), f"{q}/s"),
        ("acceleration", axis.acceleration, float(robot.acceleration_limit[index]), f"{q}/s^2"),
        ("torque", axis.torque, float(robot.torque_limit[index]), tau),
    ):
        slack = high - low if unit == q else known
        if -NARROWER * slack <= stated - known <= SAME * slack:
            continue
        sign = -1 if key == "q_min" else 1
        relation = "wider" if stated > known else "narrower"
        yield (
            ("limits", key),
            f"{sign * stated:g} {unit} of axis {axis.name} is {relation} than"
            f" {sign * known:g} {unit} in the robot file of {robot.name}; make both alike",
        )
