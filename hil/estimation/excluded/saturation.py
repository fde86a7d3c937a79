"""Torques at a limit, detected by many samples with exactly the greatest value."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.standstill import share_at_top
from hil.runs.recording import active_samples

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.runs.recording import Recorded


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
        if size.size and (share := share_at_top(size)):
            found[axis] = (share, float(size.max()))
    if not found:
        return None
    axis = max(found, key=lambda each: found[each][0])
    return axis, *found[axis]
