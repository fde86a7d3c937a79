"""Levels of friction while a run goes on: a simple figure, for the eye alone.

Over the middle half of a stroke's way the axis passes the same positions forth and back, so half
the difference of the mean torques is without gravity; what accelerates cancels too, since a stroke
brakes as it has accelerated. What is left is the friction at the speed of that stroke. It is no
result: identification compensates and weighs far more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.planning.measurement import Measurement
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

MIDDLE = (0.25, 0.75)
"""Shares of a stroke's way between which torques count."""
FEWEST = 5
"""Samples in each direction."""


class Level(NamedTuple):
    """Friction of one axis as a recording shows it.

    Attributes
    ----------
    axis : int
        Joint index, from 0.
    level : float
        Half the difference of the mean torques forth and back [N m or N].
    speed : float
        Mean speed meanwhile [rad/s or m/s].
    measurement : str
        Identifier.
    """

    axis: int
    level: float
    speed: float
    measurement: str


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
        levels = self._levels.setdefault(found.axis, [])
        levels.append(round(found.level, 4))
        return {
            "axis": found.axis,
            "level": levels[-1],
            "speed": round(found.speed, 4),
            "measurement": found.measurement,
            "count": len(levels),
            "least": min(levels),
            "most": max(levels),
        }


def level_of(measurement: Measurement, recording: Recording) -> Level | None:
    """Level of friction of the axis that goes back and forth.

    None where none does, or too few samples lie in the middle of its strokes.
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
    if min(forth.sum(), back.sum()) < FEWEST:
        return None
    return Level(
        axis,
        float(tau[forth].mean() - tau[back].mean()) / 2,
        _speed(recording, used, float(high - low)),
        measurement.id,
    )


def _speed(recording: Recording, used: NDArray[np.bool_], way: float) -> float:
    """Mean speed over the middle of all strokes [rad/s or m/s]."""
    strokes = len(np.unique(recording.stroke[used]))
    duration = used.sum() * recording.period
    return strokes * (MIDDLE[1] - MIDDLE[0]) * way / float(duration)
