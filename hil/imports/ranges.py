"""Positions, speeds and torques against the ranges and limits of the robot file."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.suspicion import Suspicion

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.imports.evidence import Evidence
    from hil.model.robot import Robot


_BEYOND = 1.05
_FAR_BEYOND = 3.0
_SMALL = 0.03
_OTHERWISE = "correct unit, offset or column, or the range in the robot file"
_BELIEVED = 1e6
"""Greatest speed, torque and force that any robot may have, if its limits are not known."""


def range_suspicions(
    evidence: Evidence, robot: Robot, unknown_gains: Sequence[int]
) -> Iterator[Suspicion]:
    """Positions beyond the joint's range; speeds and torques beyond its limits."""
    for joint in range(robot.n_joints):
        unit, q = robot.position_unit(joint), evidence.q[:, joint]
        low, high = float(robot.q_min[joint]), float(robot.q_max[joint])
        excess = max(float(q.max()) - high, low - float(q.min()))
        if excess > (_BEYOND - 1) * (high - low):
            far = excess > (_FAR_BEYOND - 1) * (high - low)
            yield Suspicion(
                "range",
                ("joints", joint, "position"),
                f"reaches from {q.min():.4g} to {q.max():.4g} {unit}, but joint {joint + 1} of"
                f" {robot.name} has {low:.4g} to {high:.4g} {unit};"
                f" {_other_unit(q, joint, robot) if far else _OTHERWISE}",
                certain=far,
            )
            continue
        for key, values, limit, per in (
            ("position", evidence.qd, robot.velocity_limit, f"{unit}/s"),
            ("torque", evidence.tau, robot.torque_limit, "N m" if unit == "rad" else "N"),
        ):
            if key == "torque" and joint in unknown_gains:
                continue
            most = float(np.abs(values[:, joint]).max())
            bound = float(np.fmin(limit[joint], _BELIEVED))
            if most > 1.2 * bound:
                yield Suspicion(
                    "range",
                    ("joints", joint, key),
                    f"{'moves with' if key == 'position' else 'has'} up to {most:.4g} {per}, but"
                    f" joint {joint + 1} of {robot.name} is limited to {bound:.4g} {per}; correct"
                    " the unit, the gain or the side, or the limit in the robot file",
                    certain=most > 10 * bound,
                )


def small_motion(evidence: Evidence, robot: Robot) -> Iterator[Suspicion]:
    """All joints move very little, like radians taken for degrees or for angles of motors."""
    shares = np.ptp(evidence.q, axis=0) / (robot.q_max - robot.q_min)
    widest = int(np.argmax(shares))
    if evidence.moves[widest] and shares[widest] < _SMALL:
        way, unit = float(np.ptp(evidence.q[:, widest])), robot.position_unit(widest)
        yield Suspicion(
            "range",
            ("joints", widest, "position"),
            f"moves by {way:.3g} {unit}, {100 * shares[widest]:.2g} % of its range, and no joint"
            " by a greater share; are unit, per_unit and position_side right?",
            certain=False,
        )


def _other_unit(q: Array, joint: int, robot: Robot) -> str:
    """State in which unit, or on which side, the positions would be within the range."""
    low, high = robot.q_min[joint], robot.q_max[joint]
    slack = 0.02 * (high - low)
    turning = bool(robot.revolute[joint])
    gear = float(robot.gear_ratio[joint])
    fitting = [
        what
        for factor, what in (
            (pi / 180 if turning else 1e-3, f"unit: {'deg' if turning else 'mm'}"),
            (1 / gear, f"the motor's side at a gear ratio of {gear:g}"),
        )
        if factor != 1 and low - slack <= factor * q.min() and factor * q.max() <= high + slack
    ]
    return f"they look like {' or '.join(fitting)}" if fitting else _OTHERWISE
