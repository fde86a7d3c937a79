"""Which samples repeat a value that the drive has not renewed, though its axis moves.

Some drives renew position or current less often than SYNC comes. A position that rests between two
steps rests in truth only if the axis could stop and start again between them, so only small steps
may be beside it. A current that is renewed every second SYNC or less often never changes twice in
succession; one that repeats by chance, since its steps are coarse, does. Where a drive is slow in
part of a recording only, all changes of its current there are multiples of some samples apart.
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
"""A step or jump of a position is so many times what acceleration, and what is usual, explain."""
LEAST = 10
"""Changes of a current from which on the time between them means anything."""
OFTEN_TIMES = 2.0
"""The same where it happens `FEW` times: from rest, an acceleration explains half a step."""
FEW = 3
"""Old positions that are more than one telegram gone wrong."""
OFTEN = 0.1
"""Share of the changes of a position that follow old ones: a drive that is slow is slow always."""
BY_CHANCE = 0.05
"""Share of the changes of a current that may follow another at once though it is renewed less
often: telegrams that came late."""

CHANCE = 1e-6
"""Probability k^-n that n changes of any current are all multiples of k samples apart: a stretch
that is less likely is that of a slow drive."""


def with_old_values(
    recording: Recording, acceleration: float, axes: Sequence[AxisInfo]
) -> Recording:
    """Return the recording with `SampleFlag.OLD` where an axis shows an old position or torque.

    Parameters
    ----------
    recording : Recording
    acceleration : float
        Highest of the motion [rad/s^2 or m/s^2].
    axes : sequence of AxisInfo
        For the steps of positions and torques.

    Raises
    ------
    DriveRefused
        A drive renews its position less often: bends of its path cannot be told from jumps.
    """
    if recording.n_samples < 3:
        return recording
    period = float(np.median(np.diff(recording.time)))
    old = np.zeros(recording.q.shape, dtype=bool)
    for k, axis in enumerate(axes):
        least = max(axis.position_resolution, acceleration * period**2)
        old[:, k], every = _old_positions(recording.q[:, k], least)
        if every > 1:
            raise DriveRefused(
                f"{axis.name}: its position is renewed only every {every} SYNCs of"
                f" {1e3 * period:.3g} ms, must be with each; set sync_period: {every * period:.3g}"
                " or more in the drives file and sample_period in the plan; hil drives check"
                " measures it"
            )
        old[:, k] |= _old_torques(recording.tau[:, k])
    if not old.any():
        return recording
    return replace(recording, flags=recording.flags | np.uint8(SampleFlag.OLD) * old)


def _old_positions(q: Array, least: float) -> tuple[Mask, int]:
    """Samples that repeat the one before, between two steps the same way of many times `least`.

    And every how many SYNCs the drive renews its position.
    """
    steps = np.diff(q)
    changes = np.flatnonzero(steps)  # a missing sample is a change of which nothing follows
    before, after = steps[changes[:-1]], steps[changes[1:]]
    rests = np.diff(changes)
    sizes = np.minimum(np.abs(before), np.abs(after)) * ((before * after > 0) & (rests > 1))
    slow = sizes > OFTEN_TIMES * least
    every = round(float(np.median(rests[slow]))) if np.sum(slow) >= FEW else 1
    if np.sum(slow) < OFTEN * np.sum(rests > 0):
        every = 1
    apart = sizes > TIMES * least
    return _repeated(changes[1:][apart], rests[apart], len(q)), every


def _old_torques(tau: Array) -> Mask:
    """Samples that repeat the one before, where hardly any two successive ones both change.

    So for a whole recording, or for a stretch of it from which on the drive was slow.
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
    """Return where the longest run of True begins, and where it has ended."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], holds.view(np.int8), [0]))))
    begins, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - begins)) if len(begins) else 0
    return (int(begins[longest]), int(ends[longest])) if len(begins) else (0, 0)


def _repeated(changes: Indices, rests: Indices, n: int) -> Mask:
    """Samples that repeat the one before, in so many steps up to each change; shape (n,)."""
    counts = np.zeros(n + 1, dtype=int)
    np.add.at(counts, changes - rests + 2, 1)
    np.add.at(counts, changes + 1, -1)
    old: Mask = np.cumsum(counts)[:n] > 0
    return old
