"""Which way a joint turns, judged by the gravity that a robot's model predicts; arrays in.

A stroke there and back over the same way cancels friction: half the sum of both mean torques is
gravity. A joint whose `sign` is wrong shows its angle and its torque with the wrong sign, so what
it measures at q is what the model predicts, turned round, at -q::

    sign right    tau(q) =  g(q)
    sign wrong    tau(q) = -g(-q)

An arm that hangs straight down is its own mirror image: both predictions are the same there, and
nothing can be found. So too where they differ by less than friction leaves undecided.
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
"""Joint torques that hold an arm at rest [N m], shape (n,), at joint coordinates, shape (n,)."""

CHECK = "direction of the joint"
SIGNIFICANT = 4.0
"""How many standard errors the two predictions must be apart."""
LEFT_OVER = 0.2
"""Share of friction that may differ between both directions, and pass for gravity."""
CLOSE = 0.3
"""The torque must be that near to one prediction, as a share of their distance."""


def judge_direction(seen: Moved, gravity: Gravity | None) -> Verdict:
    """Judge the sign of one joint.

    Parameters
    ----------
    seen : Moved
        What was seen of it.
    gravity : callable or None
        What a robot's model predicts; None where there is no model.
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
