"""Limits of the drives, compared with the plan and the robot file.

A drive's own limits may be tighter than those used for planning. Then every motion not fixed by the
plan, such as travel between measurements, respects them, and a plan beyond them is refused before
anything moves: a drive that clips a motion spoils the measurement and reports nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from drivers.drive_bus import LimitExceeded
from hil.planning.dry_run import measurement_problems

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from drivers.drive_bus import AxisInfo
    from hil.model.robot import Robot
    from hil.planning.plan import Plan


def limited(robot: Robot, axes: Sequence[AxisInfo]) -> Robot:
    """Return `robot` within the limits of its drives, for motions and checks only."""
    if len(axes) != robot.n_joints:
        return robot  # another number of axes is refused at the start of measuring
    joints = tuple(
        joint.model_copy(
            update={
                "q_min": max(joint.q_min, axis.q_min),
                "q_max": min(joint.q_max, axis.q_max),
                "velocity_limit": min(joint.velocity_limit, axis.velocity_max),
                "acceleration_limit": min(joint.acceleration_limit, axis.acceleration_max),
            }
        )
        for joint, axis in zip(robot.file.joints, axes, strict=True)
    )
    if joints == robot.file.joints:
        return robot
    return replace(robot, file=robot.file.model_copy(update={"joints": joints}))


def refuse_beyond(plan: Plan, robot: Robot, axes: Sequence[AxisInfo]) -> None:
    """Check that the plan respects the limits of the drives.

    Parameters
    ----------
    plan : Plan
        Plan to be measured.
    robot : Robot
        Robot of the plan.
    axes : sequence of AxisInfo
        Axes in joint order.

    Raises
    ------
    LimitExceeded
        A line for each problem, with measurement, joint, value and bound.
    """
    problems = measurement_problems(plan, limited(robot, axes))
    if problems:
        lines = ["the plan exceeds what the drives allow; nothing has moved"]
        lines += [problem.message for problem in problems]
        raise LimitExceeded("\n".join([*lines, *_whose(robot, axes)]))


def _whose(robot: Robot, axes: Sequence[AxisInfo]) -> Iterator[str]:
    """Yield the objects of the drives that cause the limits, where relevant."""
    for j, axis in enumerate(axes):
        for key, planned, holds in (
            ("q_min", robot.q_min[j], axis.q_min),
            ("q_max", robot.q_max[j], axis.q_max),
            ("velocity", robot.velocity_limit[j], axis.velocity_max),
            ("acceleration", robot.acceleration_limit[j], axis.acceleration_max),
        ):
            # limits of drive and robot file may differ by 0.1 % without being named
            if key in axis.own_limits and abs(holds - planned) > 1e-3 * max(1.0, abs(planned)):
                yield (
                    f"joint {j + 1} ({axis.name}): {key} of the drive {holds:.4g} "
                    f"({axis.own_limits[key]}), of the robot file {planned:.4g}; plan within the "
                    "drive's limit, or widen this limit with the maker's tool"
                )
