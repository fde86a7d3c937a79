"""Whether the current sensor is alive: a reading that repeats itself too often is stuck or clipped.

Noise makes successive readings differ. If a share r of them equals the one before, a run of k equal
readings somewhere among n has a chance of about n r^(k-1); a longer run than chance explains is no
measurement of a current.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hil.runs.finding import Finding

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.runs.recording import Recording

CHANCE = 1e-6
"""Of a sound sensor to show so long a run."""

RARE, OFTEN = 0.05, 0.9
"""Bounds of the share of equal neighbours that counts as the sensor's own."""


def frozen(recording: Recording, measurement: Measurement, robot: Robot) -> Iterator[Finding]:
    """Find where the torque of a measured axis repeats one value for too long in motion."""
    moving = recording.under_way
    for index in measurement.read:
        yield from _frozen(recording.tau[moving, index], index + 1, robot.torque_unit(index))


def _frozen(tau: Array, axis: int, unit: str) -> Iterator[Finding]:
    begin, longest = _longest_run(tau)
    bound = _explained(tau, longest)
    if longest > bound:
        yield Finding(
            "current",
            f"the current of axis {axis} reads {tau[begin]:.4g} {unit} in {longest}"
            f" samples on end, at most {bound} may; its sensor is stuck, clipped or too coarse:"
            " check the drive's current measurement and its range",
            longest,
            bound,
        )


def _longest_run(values: Array) -> tuple[int, int]:
    """Return where the longest run of equal values begins, and its length."""
    changes = np.flatnonzero(np.diff(values) != 0)
    edges = np.concatenate(([-1], changes, [len(values) - 1]))
    lengths = np.diff(edges)
    place = int(np.argmax(lengths))
    return int(edges[place]) + 1, int(lengths[place])


def _explained(values: Array, longest: int) -> int:
    """Return the longest run that chance explains, by the neighbours outside of the longest."""
    equal = int(np.count_nonzero(np.diff(values) == 0)) - (longest - 1)
    share = min(max(equal / max(1, len(values) - longest), RARE), OFTEN)
    return math.ceil(1 + math.log(CHANCE / len(values)) / math.log(share))
