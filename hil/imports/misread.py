"""Columns that are not what a map calls them.

Positions, speeds and torques beyond the ranges and limits of the robot file, or next to nothing of
them; torques that are something else, and one thing twice.
"""

from __future__ import annotations

import math
from itertools import combinations
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.evidence import Suspicion
from hil.runs.recording import CHANCE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.imports.evidence import Evidence, Excerpt
    from hil.model.robot import Robot

TOUCHES = math.ceil(-math.log2(CHANCE))
"""Samples just beside zero, all on one side of it, that are no chance: each is on either side as
likely."""
OFTEN, CLOSE = 0.95, 0.05
"""Share of the ordinary steps from sample to sample, and share of such a step that is just beside
zero: so close that either side of it is as likely."""
_SMALL = 0.03
"""Share of a limit or a range that no joint exceeds where all are in another unit, or on another
side: between 1/57 of degrees or 1/50 of gears and what robots are moved for."""
BEYOND, FAR_BEYOND = 0.05, 2.0
"""Shares of a range beyond it that are stated, since stops yield and zeros are set by eye, and that
are refused: degrees for radians exceed it 57 times."""
_OTHERWISE = "correct unit, offset or column, or the range in the robot file"


def misread_torques(
    excerpts: Sequence[Excerpt], evidence: Evidence, robot: Robot, unknown_gains: Sequence[int]
) -> Iterator[Suspicion]:
    """Torques without sign, torques that are velocities, columns that hold the same."""
    yield from _twice(excerpts, evidence)
    yield from _without_sign(excerpts)
    for joint in np.flatnonzero(evidence.moves).tolist():
        tau, qd = evidence.tau[:, joint], evidence.qd[:, joint]
        for factor, unit in ((1.0, "rad/s or m/s"), (180 / pi, "deg/s"), (30 / pi, "rpm")):
            # 5 %: friction that is viscous alone, with a coefficient of just 1 N m s/rad, is no
            # robot's
            if np.linalg.norm(tau - factor * qd) < 0.05 * np.linalg.norm(tau):
                yield Suspicion(
                    "still",
                    ("joints", joint, "torque"),
                    f"is the velocity of joint {joint + 1} in {unit}; name the torque's column",
                )
    yield from _small_torques(evidence, robot, unknown_gains)


def _twice(excerpts: Sequence[Excerpt], evidence: Evidence) -> Iterator[Suspicion]:
    n = evidence.q.shape[1]
    for i, j in combinations(range(n), 2):
        for key, arrays in (("position", [e.q for e in excerpts]),
                            ("torque", [e.tau for e in excerpts])):  # fmt: skip
            same = all(np.array_equal(array[:, i], array[:, j]) for array in arrays)
            if same and any(np.ptp(array[:, i]) > 0 for array in arrays):
                yield Suspicion(
                    "still",
                    ("joints", j, key),
                    f"is the same as that of joint {i + 1} in all samples; one of the two columns"
                    " is another's: correct it",
                )


def _without_sign(excerpts: Sequence[Excerpt]) -> Iterator[Suspicion]:
    """Torques that come to zero often and turn back each time."""
    found: dict[int, int] = {}
    for joint in range(excerpts[0].tau.shape[1]):
        parts = [excerpt.tau[:, joint] for excerpt in excerpts]
        if all(np.all(x >= 0) for x in parts) or all(np.all(x <= 0) for x in parts):
            found[joint] = sum(_touches(np.abs(x)) for x in parts)
    if sum(found.values()) >= TOUCHES:
        joints = [joint for joint, times in found.items() if times]
        yield Suspicion(
            "still",
            ("joints", joints[0], "torque"),
            f"torques of joints {', '.join(str(joint + 1) for joint in joints)} come to zero"
            f" {sum(found.values())} times and never cross it: they have lost their signs, as sizes"
            " of currents have; name columns with signs",
        )


def _touches(x: Array) -> int:
    """Samples as close to zero as they would be by chance where they cross it."""
    return int(np.count_nonzero((x > 0) & (x < CLOSE * np.quantile(np.abs(np.diff(x)), OFTEN))))


def _small_torques(
    evidence: Evidence, robot: Robot, unknown_gains: Sequence[int]
) -> Iterator[Suspicion]:
    """All joints have very little torque, like that of motors taken for joints."""
    shares = np.abs(evidence.tau).max(axis=0) / robot.torque_limit
    if unknown_gains or not np.isfinite(shares).all():
        return
    widest = int(np.argmax(shares))
    if 0 < shares[widest] < _SMALL:
        yield Suspicion(
            "range",
            ("joints", widest, "torque"),
            f"has up to {np.abs(evidence.tau[:, widest]).max():.3g}"
            f" {'N m' if robot.revolute[widest] else 'N'}, {100 * shares[widest]:.2g} % of its"
            " limit, and no joint a greater share; are unit, gain and torque_side right?",
            certain=False,
        )


def range_suspicions(
    evidence: Evidence, robot: Robot, unknown_gains: Sequence[int]
) -> Iterator[Suspicion]:
    """Positions beyond the joint's range; speeds and torques beyond its limits."""
    for joint in range(robot.n_joints):
        unit, q = robot.position_unit(joint), evidence.q[:, joint]
        low, high = float(robot.q_min[joint]), float(robot.q_max[joint])
        excess = max(float(q.max()) - high, low - float(q.min()))
        if excess > BEYOND * (high - low):
            far = excess > FAR_BEYOND * (high - low)
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
            # greatest speed, torque and force that any robot may have, if its limits are not known:
            # 1e6
            bound = float(np.fmin(limit[joint], 1e6))
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
