"""The tighter of two limits applies: the robot file's or the drive's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.drive_bus import AxisInfo, LimitExceeded
from hil.measuring.campaign import limited, refuse_beyond

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.planning.plan import Plan


def drives(robot: Robot, share: float) -> list[AxisInfo]:
    """Return drives whose own limits are this share of the limits in the robot file."""
    return [
        AxisInfo(
            f"joint {j + 1}",
            "a drive",
            share * float(robot.q_min[j]),
            share * float(robot.q_max[j]),
            share * float(robot.velocity_limit[j]),
            share * float(robot.acceleration_limit[j]),
            0.1,
            1e-5,
        )
        for j in range(robot.n_joints)
    ]


@pytest.mark.parametrize(("share", "holds"), [(0.5, 0.5), (1.0, 1.0), (2.0, 1.0)])
def test_the_tighter_limit_holds(manutec: Robot, share: float, holds: float) -> None:
    found = limited(manutec, drives(manutec, share))
    for name in ("q_min", "q_max", "velocity_limit", "acceleration_limit"):
        assert np.allclose(getattr(found, name), holds * getattr(manutec, name)), name


def test_a_plan_beyond_what_the_drives_allow_is_refused(small_plan: Plan, manutec: Robot) -> None:
    refuse_beyond(small_plan, manutec, drives(manutec, 1.0))
    with pytest.raises(LimitExceeded, match="is above the limit of joint"):
        refuse_beyond(small_plan, manutec, drives(manutec, 0.1))
