"""Levels of friction while a run goes on: a simple figure, for the eye alone.

Over the middle half of a stroke's way the axis passes the same positions forth and back, so half
the difference of the mean torques is without gravity; what accelerates cancels too, since a stroke
brakes as it has accelerated. What is left is the friction at the speed of that stroke. It is no
result: identification compensates and weighs far more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hil.planning.measurement import Measurement
    from hil.runs.recording import Recording

MIDDLE = (0.25, 0.75)
"""Shares of a stroke's way between which torques count."""


class FrictionSoFar:
    """Levels of all axes, as recordings come."""

    def __init__(self) -> None:
        self._levels: dict[int, list[float]] = {}

    def with_recording(
        self, measurement: Measurement, recording: Recording
    ) -> dict[str, object] | None:
        """What stands in the line ``level``; None where a recording shows no level."""
        found = level_of(measurement, recording)
        if found is None:
            return None
        (axis,), (level, speed) = measurement.read, found
        levels = self._levels.setdefault(axis, [])
        levels.append(round(level, 4))
        return {
            "axis": axis,
            "level": levels[-1],
            "speed": round(speed, 4),
            "measurement": measurement.id,
            "count": len(levels),
            "least": min(levels),
            "most": max(levels),
        }


def level_of(measurement: Measurement, recording: Recording) -> tuple[float, float] | None:
    """Level of friction of the axis that goes back and forth, and its mean speed meanwhile.

    None where none does, or fewer than five samples of a direction lie in the middle of its
    strokes.

    Returns
    -------
    level : float
        Half the difference of the mean torques forth and back [N m or N].
    speed : float
        [rad/s or m/s].
    """
    if len(measurement.read) != 1:
        return None
    axis = measurement.read[0]
    q, tau = recording.q[:, axis], recording.tau[:, axis]
    under_way = (recording.stroke >= 0) & np.isfinite(q) & np.isfinite(tau)
    if not under_way.any():
        return None
    low, high = q[under_way].min(), q[under_way].max()
    share = (q - low) / max(high - low, np.finfo(float).tiny)
    used = under_way & (share > MIDDLE[0]) & (share < MIDDLE[1])
    forth, back = (used & (recording.stroke % 2 == side) for side in (0, 1))
    if min(forth.sum(), back.sum()) < 5:
        return None
    way = len(np.unique(recording.stroke[used])) * (MIDDLE[1] - MIDDLE[0]) * float(high - low)
    speed = way / float(used.sum() * recording.period)
    return float(tau[forth].mean() - tau[back].mean()) / 2, speed
