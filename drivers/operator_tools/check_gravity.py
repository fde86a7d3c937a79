"""Check of a joint's direction by the gravity torque of a robot's model.

A stroke in both directions over the same path cancels friction: half the sum of the two mean
torques is gravity. A joint with a wrong `sign` shows angle and torque with the wrong sign, so the
measurement at q is the negative prediction at -q::

    sign right    tau(q) =  g(q)
    sign wrong    tau(q) = -g(-q)

An arm hanging straight down is symmetric: both predictions agree there, and the check is undecided.
So it is if they differ by less than the uncertainty due to friction.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from drivers.commissioning.verdict import Grade, Verdict, undecided

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from drivers.operator_tools.check_motion import Moved

Gravity: TypeAlias = "Callable[[NDArray[np.float64]], NDArray[np.float64]]"
"""Holding torques of an arm [N m], shape (n,), at joint coordinates, shape (n,)."""

CHECK = "direction of the joint"
SIGNIFICANT = 4.0
"""Smallest difference of the two predictions, in standard errors."""
LEFT_OVER = 0.2
"""Share of friction that may differ between the directions and appear as gravity."""
CLOSE = 0.3
"""Largest deviation of the torque from one prediction, as a share of their difference."""


def judge_direction(seen: Moved, gravity: Gravity | None) -> Verdict:
    """Judge the sign of a joint.

    Parameters
    ----------
    seen : Moved
        Observation of the axis.
    gravity : callable or None
        Holding torques by a robot's model; None without a model.
    """
    place, drive, strokes = seen.place, seen.drive, seen.strokes
    if gravity is None:
        remedy = "watch a jog, or give a run's model"
        return undecided(place, CHECK, "no model of the robot", remedy)
    measured, error = seen.gravity
    if not math.isfinite(error):
        return undecided(place, CHECK, "too few samples at constant speed", "move farther")
    passed = np.linspace(strokes[0].q[0], strokes[0].move.target, 11)
    right = float(np.mean([_torque(gravity, seen, q) for q in passed]))
    wrong = -float(np.mean([_torque(gravity, seen, -q) for q in passed]))
    unit = drive.effort_unit
    found = f"gravity {measured:+.3g} {unit}"
    bound = f"model: {right:+.3g} {unit}, turned round {wrong:+.3g} {unit}"
    apart = abs(right - wrong)
    if apart < SIGNIFICANT * error + LEFT_OVER * abs(seen.friction[0]):
        remedy = "both are too near to each other here: bring the arm to where it is not upright"
        return undecided(place, CHECK, found, remedy, bound)
    if abs(measured - right) < CLOSE * apart:
        return Verdict(Grade.OK, place, CHECK, f"confirmed, {found}", bound)
    if abs(measured - wrong) < CLOSE * apart:
        remedy = f"set sign: {-drive.sign} in the drives file, and zero anew"
        return Verdict(Grade.REFUSED, place, CHECK, f"contradicts, {found}", bound, remedy)
    remedy = "neither: compare gear_ratio, zero, the unit of the current, and the payload"
    return undecided(place, CHECK, found, remedy, bound)


def _torque(gravity: Gravity, seen: Moved, q: float) -> float:
    at = seen.pose.copy()
    at[seen.number] = q
    return float(gravity(at)[seen.number])
