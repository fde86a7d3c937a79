"""Detection of encoder jumps in motion: bends of positions beyond possible accelerations.

A jump shifts the position reference permanently, and the drive's loop moves the axis by the same
amount, so that all later measurements have wrong angles: a jump ends the campaign. Large jumps trip
the driver at once; small ones are found here, in every motion as soon as it is over.

On the wall clock a sample may be as old as its period: the driver accepts answers to SYNC k until
it sends SYNC k + 1, so the instant of sample k is off by at most the interval after its time stamp.
At a speed v such a sample looks like a jump of v times that interval, and the next sample is back
on the path. After a jump, positions stay off the path until the loop has brought the axis back. So
a bend counts as a jump only if none of the two samples after it is within reach of the path before,
and none of the two samples before it within reach of the path after.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import SampleFlag, Tripped
from hil.measuring.checks.old_values import TIMES, mark_old_values
from hil.runs.journal import EXACT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import DriveBus
    from hil.arrays import Array, Indices
    from hil.runs.recording import Recorder, Recording

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
    recording : Recording
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
    """Positions of an axis, shape (n,), at increasing instants with errors up to `age`.

    Parameters
    ----------
    time, q : arrays (n,)
        Time stamps [s] and positions [rad or m].
    age : float
        Expected interval after the last sample [s]; 0 if all instants are exact.
    """

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

        Parameters
        ----------
        before : array of int, shape (k,)
            Last samples before the bends.
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
    begun = np.concatenate((np.repeat(values[:1], AROUND - 1), values))
    return np.median(np.lib.stride_tricks.sliding_window_view(begun, AROUND), axis=1)
