"""A motion to judge a model by: all axes at once, unlike what it was identified from."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.planning.design.trajectories import PERIOD, Search, design_trajectory
from hil.planning.plan import Plan, PlannedRobot

if TYPE_CHECKING:
    from hil.model.robot import Robot

SEED = 22
"""Of the search: not that of `hil trajectory plan`, whose motion models are made from."""
PERIODS = 3
EFFORT = Search(random=100, refined=1, steps=10)
"""No best motion is needed, only another one."""


def design_validation(robot: Robot) -> Plan:
    """Plan half a minute of an exciting trajectory."""
    return Plan(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        measurements=(
            design_trajectory(robot, PERIOD, PERIODS, seed=SEED, search=EFFORT, name="validation"),
        ),
    )
