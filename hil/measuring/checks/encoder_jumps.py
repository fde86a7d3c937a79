"""Detection of encoder jumps in motion, and of stale samples.

A jump is a bend of positions beyond possible accelerations. It shifts the position reference
permanently, and the drive's loop moves the axis by the same amount, so that all later measurements
have wrong angles: a jump ends the campaign. Large jumps trip the driver at once; small ones are
found here, in every motion as soon as it is over.

On the wall clock a sample may be as old as its period: the driver accepts answers to SYNC k until
it sends SYNC k + 1, so the instant of sample k is off by at most the interval after its time stamp.
At a speed v such a sample looks like a jump of v times that interval, and the next sample is back
on the path. After a jump, positions stay off the path until the loop has brought the axis back. So
a bend counts as a jump only if none of the two samples after it is within reach of the path before,
and none of the two samples before it within reach of the path after.

Stale samples are values not renewed by the drive although the axis moves. Some drives renew
position or current less often than SYNC comes. A position that rests between two steps is genuine
only if the axis could stop and start again between them, so only small steps may surround it. A
current renewed every second SYNC or less often never changes twice in succession; a current
repeated by chance, because of coarse steps, does. Where a drive is slow in a part of a recording,
all changes of its current there are multiples of some samples apart.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import DriveRefused, SampleFlag, Tripped
from hil.runs.journal import EXACT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import AxisInfo, DriveBus
    from hil.arrays import Array, Indices, Mask
    from hil.runs.recording import Recorder, Recording


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


_ELSEWHERE = SampleFlag.LATE | SampleFlag.OLD | SampleFlag.UNTIMED
"""Flags of positions whose instant differs from their time stamp."""
USUAL = 0.99
"""Share of the bends of a motion that count as usual."""
OF_ONE_JUMP = 6
"""Number of largest bends that never count as usual.

In a short motion a jump, and the response of the loop within a few samples, are more than one bend
in a hundred.
"""
AROUND = 3
"""Number of samples, and of intervals, for the median path on either side of a bend.

A single wrong time stamp among them has no effect.
"""


def finished(bus: DriveBus, recorder: Recorder, acceleration: float) -> Recording:
    """Convert the recording of a motion to arrays with all flags; see `refuse_jumps`.

    Raises
    ------
    DriveRefused
        A drive renews its position less often than SYNC comes.
    Tripped
        An encoder jumped.
    """
    recording = mark_old_values(recorder.finish(), acceleration, bus.axes)
    resolution, units = [a.position_resolution for a in bus.axes], [a.unit for a in bus.axes]
    refuse_jumps(recording, acceleration, resolution, units)
    return recording


def refuse_jumps(
    recording: Recording,
    acceleration: float,
    resolution: Sequence[float] | float = 0.0,
    units: Sequence[str] = (),
) -> None:
    """Refuse a recording with a position jump.

    Parameters
    ----------
    acceleration : float
        Highest acceleration of the motion [rad/s^2 or m/s^2].
    resolution : sequence (n_joints,) or float
        Steps of the encoders [rad or m]: in a creep, positions are constant for many samples
        between two steps.
    units : sequence of str
        Units of the axes' positions; rad by default.

    Raises
    ------
    Tripped
        Message with axis, size and instant of the first jump.
    """
    advances = np.diff(recording.time, prepend=-np.inf) > 0.0  # a doubled sample has no interval
    intervals = np.diff(recording.time[advances])
    if len(intervals) < 2:
        return
    period = float(np.median(intervals))
    off = intervals - np.rint(intervals / period) * period
    age = 0.0 if np.abs(off).max() <= EXACT else period
    known = np.isfinite(recording.q) & (recording.flags & _ELSEWHERE == 0)
    known &= advances[:, None]
    found = []
    for axis, least in enumerate(np.broadcast_to(resolution, recording.n_joints)):
        path = _Path(recording.time[known[:, axis]], recording.q[known[:, axis], axis], age)
        found += [(*jump, axis) for jump in path.jumps(acceleration, float(least))]
    if found:
        instant, size, most, axis = min(found)
        unit = units[axis] if units else "rad"
        raise Tripped(
            f"axis {axis + 1}: its position jumps by {size:.2g} {unit} at {instant:.3f} s, at "
            f"most {most:.2g} {unit} possible by motion; check encoder and cable, and reference "
            "the axis anew before measuring again"
        )


class _Path:
    """Positions of an axis [rad or m] at increasing instants [s] with errors up to `age` [s]."""

    def __init__(self, time: Array, q: Array, age: float) -> None:
        self._time, self._q = time, q
        self._intervals = np.diff(time)
        self._speeds = np.diff(q) / self._intervals
        self._ages = np.append(self._intervals, age) * (age > 0)

    def jumps(self, acceleration: float, resolution: float) -> list[tuple[float, float, float]]:
        """Return instant [s], size and bound [rad or m] of the first jump, if any."""
        if len(self._speeds) < 2:
            return []
        here = self._intervals[1:]
        bends = np.abs(np.diff(self._speeds)) * here
        motion = np.maximum(resolution, acceleration * here * (here + self._intervals[:-1]) / 2)
        # two instants of a bend may have errors of opposite sign
        reach = (
            2 * np.minimum(self._ages[1:-1], self._ages[-1]) * np.abs(_median(self._speeds[:-1]))
        )
        beyond = np.maximum(0.0, bends - reach)
        place = max(0, min(len(beyond) - 1 - OF_ONE_JUMP, int(len(beyond) * USUAL)))
        # bends of whole increments may equal their bound: half an increment decides, not rounding
        bounds = TIMES * np.maximum(np.partition(beyond, place)[place], motion) + resolution / 2
        at = np.flatnonzero(bends > bounds)
        if len(at) and self._ages.any():
            at = at[self._off_path(at + 1) > bounds[at]]
        return [(float(self._time[k + 1]), float(bends[k]), float(bounds[k])) for k in at[:1]]

    def _off_path(self, before: Indices) -> Array:
        """Return distances of two samples after bends from the path before, or vice versa [rad, m].

        `before` are the last samples before the bends.
        """
        last = len(self._q) - 1
        speeds = (
            _median(self._speeds)[before - 1],
            _median(self._speeds[::-1])[::-1][np.minimum(before + 1, last - 1)],
        )
        slower = np.minimum(*np.abs(speeds))  # after a jump the loop adds a speed of its own
        off, signs = [], []
        for speed, end, step in ((speeds[0], before, 1), (speeds[1], before + 1, -1)):
            around = np.clip(end - step * np.arange(AROUND)[:, None], 0, last)
            beyond = np.clip(end + step * np.array([[1], [2]]), 0, last)
            base = np.median(self._q[around] - speed * self._time[around], axis=0)
            shifts = self._q[beyond] - speed * self._time[beyond] - base
            reached = np.min(np.abs(shifts) - slower * self._ages[beyond], axis=0)
            signs.append(np.sign(shifts) * step)
            off.append(reached)
        # positions curved by an acceleration are on the same side of both lines
        same = np.ptp(np.concatenate(signs), axis=0) == 0
        return np.where(same, np.minimum(*off), 0.0)


def _median(values: Array) -> Array:
    """Return the running median of values and their predecessors."""
    return median_of_three(np.concatenate((np.repeat(values[:1], AROUND - 1), values)))


def median_of_three(values: Array) -> Array:
    """Return the medians of `AROUND` successive values, in a twentieth of NumPy's time."""
    low, middle, high = values[:-2], values[1:-1], values[2:]
    most = np.maximum(low, middle)
    return np.maximum(np.minimum(low, middle), np.minimum(most, high))
