"""Torques at their limit: many samples at one and the same greatest value."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.mistakes.mistake import Mistake, MistakeName

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion


LEVEL = 0.01
"""Share of the samples in motion at the greatest torque from which on it is a limit."""
NEXT = 5.0
"""Times as many as the next lower torques of the same width have, which is no coincidence."""
_WIDTH = 1e-6


def saturated(robot: Robot, prepared: Sequence[tuple[ParameterMotion, Signals]]) -> Mistake | None:
    """Find the axis whose torque is at its limit most often, if any is."""
    found = {}
    for axis in range(robot.n_joints):
        own = [np.abs(s.tau[s.under_way, axis]) for m, s in prepared if axis in m.moved]
        size = np.concatenate(own) if own else np.zeros(0)
        if size.size and (share := share_at_top(size)) > LEVEL:
            found[axis] = (share, float(size.max()))
    if not found:
        return None
    axis, (share, top) = max(found.items(), key=lambda each: each[1][0])
    unit = robot.torque_unit(axis)
    detail = f"{share:.0%} of its samples have one and the same greatest torque, {top:.3g} {unit}"
    return Mistake(MistakeName.SATURATION, (axis + 1,), detail, 1.0)


def share_at_top(size: Array) -> float:
    """Share of samples at the greatest torque, if that holds far more than values below it."""
    at_top = int(np.sum(size >= size.max() * (1 - _WIDTH)))
    below = np.unique(size[size < size.max() * (1 - _WIDTH)], return_counts=True)[1][-20:]
    usual = float(below.max()) if below.size else 0.0
    return at_top / len(size) if at_top > NEXT * usual else 0.0
