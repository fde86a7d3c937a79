"""What a dry run says about a trajectory: limits along the whole of it, not at its ends alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory

ACCELERATION_SHARE = 0.5
"""Of each axis's acceleration limit that a trajectory may use. The limit is what an axis can do
while the others rest. On a trajectory all accelerate at once and load each other; how much, nobody
knows before the model is known. At 0.9 of it drives of the manutec-r15 saturate and fault."""
AT_REST = 1e-3
"""Share of the limits of velocity and acceleration that a period may begin with."""
ROUNDED = 0.5e-6
"""By which plans round amplitudes, so that no sum of them is exactly zero [rad or m]."""
_WHY = {
    "acceleration": f", {ACCELERATION_SHARE:.0%} of its limit, since all axes load each other",
}


def check_trajectory(trajectory: Trajectory, robot: Robot, period: float) -> Iterator[str]:
    """Find what is wrong with a trajectory, sampled every `period` [s].

    Yields
    ------
    str
        Joint, value, bound and remedy.
    """
    t = np.arange(0.0, trajectory.period + period, period)
    q, qd, qdd = trajectory.motion(t)
    for joint in range(robot.n_joints):
        share = ACCELERATION_SHARE
        unit = robot.position_unit(joint)
        for what, values, low, high, per in (
            ("position", q, float(robot.q_min[joint]), float(robot.q_max[joint]), unit),
            ("velocity", qd, *_about(robot.velocity_limit[joint]), f"{unit}/s"),
            ("acceleration", qdd, *_about(share * robot.acceleration_limit[joint]), f"{unit}/s^2"),
        ):
            along = values[:, joint]
            worst = float(along.min() if low - along.min() > along.max() - high else along.max())
            if not low <= worst <= high:
                yield (
                    f"{trajectory.id}: {what} of joint {joint + 1} reaches {worst:.5g} {per},"
                    f" outside {low:.5g} ... {high:.5g} {per}{_WHY.get(what, '')}; make the"
                    " amplitudes smaller or the period longer"
                )
        order = 2 * np.pi / trajectory.period * np.arange(1, len(trajectory.sine[0]) + 1)
        for what, values, limit, rounding in (
            ("velocity", qd, float(robot.velocity_limit[joint]), ROUNDED * order.sum()),
            ("acceleration", qdd, float(robot.acceleration_limit[joint]), ROUNDED * order @ order),
        ):
            if abs(values[0, joint]) > max(AT_REST * limit, rounding):
                yield (
                    f"{trajectory.id}: joint {joint + 1} begins with {what}"
                    f" {values[0, joint]:.3g}, must rest: choose sines with sum k sine_k = 0 and"
                    " cosines with sum k^2 cosine_k = 0"
                )


def _about(limit: float) -> tuple[float, float]:
    return -float(limit), float(limit)
