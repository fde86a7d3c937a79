"""What one field of a robot file alone cannot show: names that nothing has, what moving needs."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from hil.model.robot_file import split_tie

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.model.robot_arrays import RobotArrays

    Problem = tuple[tuple[str | int, ...], str]

_NEEDED = "is unknown; state it, since nothing moves without it"
_TIE = re.compile(r"^\s*(\w+)\s*=\s*(\w+)\s*$")


def wrong_names(robot: RobotArrays) -> Iterator[Problem]:
    """Yield the place in the file, and what is wrong there."""
    yield from _unknown_lengths(robot)
    yield from _wrong_ties(robot)
    yield from _wrong_couplings(robot)
    yield from _wrong_springs(robot)


def unknown_for_motion(robot: RobotArrays) -> Iterator[Problem]:
    """Yield what the file leaves unknown and nothing moves without; rotor inertias are not."""
    limits = ("velocity_limit", "acceleration_limit", "torque_limit")
    for j, joint in enumerate(robot.file.joints):
        for key in limits:
            if np.isnan(getattr(robot, key)[j]):
                yield ("joints", j, key), _NEEDED
        if joint.drive is None:
            yield (
                ("joints", j),
                "drive is not stated; nothing moves without its gear_ratio",
            )
            continue
        for key in ("gear_ratio", "torque_constant"):
            if np.isnan(getattr(robot, key)[j]):
                yield ("joints", j, "drive", key), _NEEDED


def _unknown_lengths(robot: RobotArrays) -> Iterator[Problem]:
    known = robot.file.lengths
    for index in range(robot.n_joints):
        for key in ("d", "r"):
            expression = (robot.d_expressions if key == "d" else robot.r_expressions)[index]
            for name in sorted(expression.names - set(known)):
                names = f"known are {', '.join(known)}" if known else "none are named"
                yield ("joints", index, "frame", key), f"{name} is no length; {names} in lengths"


def _wrong_ties(robot: RobotArrays) -> Iterator[Problem]:
    valid = [tie for tie in robot.file.ties if _TIE.match(tie)]
    left = [split_tie(tie)[0] for tie in valid]
    for index, tie in enumerate(robot.file.ties):
        at = ("ties", index)
        if tie not in valid:
            yield at, f"{tie!r} must read as in: Iyy6 = Ixx6"
            continue
        tied, value = split_tie(tie)
        absent = [name for name in (tied, value) if name not in robot.present]
        if absent:
            yield at, f"{absent[0]} is not present; add it to its joint's parameters"
        elif tied == value or left.count(tied) > 1:
            yield at, f"{tied} is tied twice or to itself; remove this tie"
        elif value in left:
            yield at, f"{value} is tied itself; tie {tied} to what {value} is tied to"
        elif tied[0] != value[0]:
            yield at, f"{tied} and {value} have different units; tie inertia to inertia"


def _wrong_couplings(robot: RobotArrays) -> Iterator[Problem]:
    stated = robot.file.couplings or ()
    for index, coupling in enumerate(stated):
        for key in ("motor", "joint"):
            number = getattr(coupling, key)
            if number > robot.n_joints:
                yield (
                    ("couplings", index, key),
                    f"{number} must be one of the {robot.n_joints} joints",
                )
        if coupling.motor in [other.motor for other in stated[:index]]:
            yield (
                ("couplings", index, "motor"),
                f"motor {coupling.motor} is coupled already; one joint besides its own is the most",
            )


def _wrong_springs(robot: RobotArrays) -> Iterator[Problem]:
    stated = robot.file.springs or ()
    for index, spring in enumerate(stated):
        if spring.joint > robot.n_joints:
            at = ("springs", index, "joint")
            yield at, f"{spring.joint} must be one of the {robot.n_joints} joints"
        elif spring in stated[:index]:
            yield ("springs", index), "stands twice; remove one of them"
        elif spring.shape != "linear" and not robot.revolute[spring.joint - 1]:
            at = ("springs", index, "shape")
            yield at, f"{spring.shape} must be linear at a joint that slides"
