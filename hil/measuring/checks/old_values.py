"""Detection of stale samples: values not renewed by the drive although the axis moves.

Some drives renew position or current less often than SYNC comes. A position that rests between two
steps is genuine only if the axis could stop and start again between them, so only small steps may
surround it. A current renewed every second SYNC or less often never changes twice in succession; a
current repeated by chance, because of coarse steps, does. Where a drive is slow in a part of a
recording, all changes of its current there are multiples of some samples apart.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import DriveRefused, SampleFlag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import AxisInfo
    from hil.arrays import Array, Indices, Mask
    from hil.runs.recording import Recording

TIMES = 5.0
"""Minimum ratio of a position's step to the usual step and
to the step explained by acceleration.
"""
LEAST = 10
"""Minimum number of changes of a current for a judgement of the intervals."""
OFTEN_TIMES = 2.0
"""Minimum ratio as `TIMES`, but for `FEW` occurrences: from rest, acceleration explains half a
step.
"""
FEW = 3
"""Minimum number of stale positions that cannot be transmission errors."""
OFTEN = 0.1
"""Minimum share of changes after stale positions: a slow drive is always slow."""
BY_CHANCE = 0.05
"""Maximum share of successive changes of a slowly renewed current: late telegrams."""

CHANCE = 1e-6
"""Probability k^-n that n changes of any current are all multiples of k samples apart.

A less likely stretch belongs to a slow drive.
"""


def mark_old_values(
    recording: Recording, acceleration: float, axes: Sequence[AxisInfo]
) -> Recording:
    """Return the recording with `SampleFlag.OLD` at stale positions or torques.

    Parameters
    ----------
    recording : Recording
    acceleration : float
        Highest acceleration of the motion [rad/s^2 or m/s^2].
    axes : sequence of AxisInfo
        Axes, for the steps of positions and torques.

    Raises
    ------
    DriveRefused
        A drive renews its position less often: bends of its path cannot be distinguished from
        jumps.
    """
    if recording.n_samples < 3:
        return recording
    period = float(np.median(np.diff(recording.time)))
    old = np.zeros(recording.q.shape, dtype=bool)
    for k, axis in enumerate(axes):
        step = axis.position_resolution
        least = max(step, acceleration * period**2)
        old[:, k], every = _old_positions(recording.q[:, k], least, step)
        if every > 1:
            raise DriveRefused(
                f"{axis.name}: position updated only every {every} SYNCs of {1e3 * period:.3g} "
                f"ms, must be every SYNC; set sync_period: {every * period:.3g} or more in the "
                "drives file and sample_period in the plan; hil drives check measures it"
            )
        old[:, k] |= _old_torques(recording.tau[:, k])
    if not old.any():
        return recording
    return replace(recording, flags=recording.flags | np.uint8(SampleFlag.OLD) * old)


def _old_positions(q: Array, least: float, increment: float) -> tuple[Mask, int]:
    """Return stale samples, between two large steps in one direction, and the renewal in SYNCs.

    The renewal is the number of SYNCs between two new positions.
    """
    steps = np.diff(q)
    changes = np.flatnonzero(steps)  # a missing sample counts as a change without any consequence
    before, after = steps[changes[:-1]], steps[changes[1:]]
    rests = np.diff(changes)
    sizes = np.minimum(np.abs(before), np.abs(after)) * ((before * after > 0) & (rests > 1))
    # whole increments may equal a bound: half an increment decides, not rounding
    sizes -= increment / 2
    slow = sizes > OFTEN_TIMES * least
    every = round(float(np.median(rests[slow]))) if np.sum(slow) >= FEW else 1
    if np.sum(slow) < OFTEN * np.sum(rests > 0):
        every = 1
    apart = sizes > TIMES * least
    return _repeated(changes[1:][apart], rests[apart], len(q)), every


def _old_torques(tau: Array) -> Mask:
    """Return stale samples of a current that hardly ever changes twice in succession.

    Stretches may cover a part of the recording only.
    """
    changes = np.flatnonzero(np.diff(tau[np.isfinite(tau)]))
    intervals = np.diff(changes)
    if len(intervals) < LEAST or intervals.max() == 1:
        return np.zeros(len(tau), dtype=bool)
    if float(np.mean(intervals == 1)) < BY_CHANCE:
        changes = np.flatnonzero(np.diff(tau))
        return _repeated(changes[1:], np.diff(changes), len(tau))
    first, last = longest_run(intervals > 1)
    grid = int(np.gcd.reduce(intervals[first:last])) if last > first else 1
    if (last - first) * np.log(grid) < np.log(len(tau) / CHANCE):
        return np.zeros(len(tau), dtype=bool)
    finite = np.flatnonzero(np.isfinite(tau))
    at = finite[changes[first : last + 1]]
    return _repeated(at[1:], np.diff(at), len(tau))


def longest_run(holds: Mask) -> tuple[int, int]:
    """Return start and end of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], holds.view(np.int8), [0]))))
    begins, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - begins)) if len(begins) else 0
    return (int(begins[longest]), int(ends[longest])) if len(begins) else (0, 0)


def _repeated(changes: Indices, rests: Indices, n: int) -> Mask:
    """Return a mask of the samples that repeat their predecessors before changes, shape (n,)."""
    counts = np.zeros(n + 1, dtype=int)
    np.add.at(counts, changes - rests + 2, 1)
    np.add.at(counts, changes + 1, -1)
    old: Mask = np.cumsum(counts)[:n] > 0
    return old
