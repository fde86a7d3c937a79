"""Torques at a limit, detected by many samples with exactly the greatest value."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.runs.recording import active_samples

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.runs.recording import Recorded


LEVEL = 0.01
"""Minimum share of moving samples at the greatest torque, for a limit."""
NEXT = 5.0
"""Minimum ratio of samples at the greatest torque to samples in the next lower interval of equal
width.
"""
_WIDTH = 1e-6


def saturated(recorded: Recorded, n_joints: int) -> tuple[int, float, float] | None:
    """Return the most often saturated axis (from 0), the share of samples, and the limit.

    Torques are as recorded: after compensation of a lag no two are equal.
    """
    sizes: list[list[Array]] = [[] for _ in range(n_joints)]
    for motion, recording in recorded:
        moving = active_samples(recording.stroke, recording.group)
        size = np.abs(recording.tau[moving & np.isfinite(recording.tau).all(axis=1)])
        for axis in motion.moved:
            sizes[axis].append(size[:, axis])
    found = {}
    for axis, own in enumerate(sizes):
        size = np.concatenate(own) if own else np.zeros(0)
        if size.size and (share := share_at_top(size)) > LEVEL:
            found[axis] = (share, float(size.max()))
    if not found:
        return None
    axis = max(found, key=lambda each: found[each][0])
    return axis, *found[axis]


def share_at_top(size: Array) -> float:
    """Return the share of samples at the greatest torque; 0 if lower torques are as frequent.

    A torque of 0 throughout is no limit: the joint has no motor.
    """
    if not size.max():
        return 0.0
    at_top = int(np.sum(size >= size.max() * (1 - _WIDTH)))
    below = np.unique(size[size < size.max() * (1 - _WIDTH)], return_counts=True)[1][-20:]
    usual = float(below.max()) if below.size else 0.0
    return at_top / len(size) if at_top > NEXT * usual else 0.0
