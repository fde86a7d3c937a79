"""Sampling instants: from time stamps, or evenly spaced.

Instants are the stamps, or even instants from counting samples: the choice with smoother positions
is taken. A polling recorder is late at sampling, and its stamps are right; a recorder that stamps
on arrival is late at stamping, and the count is right. With equal stamps in more than a twentieth
of the rows the clock is coarse, and the count is right as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array, Integers
    from hil.imports.samples import Samples


EVEN = 0.01
"""Maximum deviation of even samples from the period, as a share."""
SAME_STAMP = 1e-6
"""Maximum difference between equal stamps, in periods."""
WINDOW = 50
"""Samples over which periods are averaged and the least delayed sample is found."""

Instants = Literal["even", "counted", "stamped"]


@dataclass(frozen=True, eq=False)
class Stretch:
    """Part of a recording without a gap.

    Attributes
    ----------
    rows : array (n,) of int
        Rows of the samples, in the order of time.
    instants : array (n,)
        Instants of the samples, rising [s].
    period : float
        Period of an even grid [s].
    """

    rows: Integers
    instants: Array
    period: float

    @property
    def duration(self) -> float:
        """Duration from the first to the last sample [s]."""
        return float(self.instants[-1] - self.instants[0])

    @property
    def bridged(self) -> int:
        """Number of interpolated samples on the grid."""
        return max(0, round(self.duration / self.period) + 1 - len(self.rows))


def lost(time: Array, at: Integers, period: float) -> Array:
    """Return the time missing after some samples, not compensated by later samples [s].

    Stamps may be late, never early: the least late stamps before and after give the time that
    passed for the samples in between.

    Parameters
    ----------
    time : array (n,)
    at : array (m,) of int
        Indices of samples, excluding the last one.
    """
    late, last = time - period * np.arange(len(time)), len(time) - 1
    reach = np.minimum((time[at + 1] - time[at]) / period, len(time)).astype(np.int64) + 7
    found = np.empty(len(at))
    for each in np.unique(reach):
        here, window = at[reach == each, np.newaxis], np.arange(each)
        before, after = late[(here - window).clip(0)], late[(here + 1 + window).clip(max=last)]
        found[reach == each] = after.min(axis=1) - before.min(axis=1)
    return found


def instants_of(samples: Samples, parts: list[Integers], period: float) -> Instants:
    """Return the kind of instants: even, or else the smoother choice of counted and stamped."""
    steps = [np.diff(samples.time[rows]) for rows in parts]
    if all(np.all(np.abs(s - period) < EVEN * period) for s in steps):
        return "even"
    every = np.concatenate(steps)
    # a clock is coarse if one row in twenty repeats the stamp of another row
    if np.mean(every <= SAME_STAMP * period) > 0.05:
        return "counted"
    rough = np.zeros((2, samples.n_joints))
    for rows in _some_of(parts):
        q, h = samples.read(rows)[:, : samples.n_joints], np.diff(samples.time[rows])
        rough += roughness(q, h, period)
    some = rough.min(axis=0) > 0
    counted_is_smoother = bool(np.sum(np.log(rough[0, some] / rough[1, some])) < 0)
    return "counted" if counted_is_smoother else "stamped"


def _some_of(parts: list[Integers]) -> Iterator[Integers]:
    # maximum number of samples for the comparison, whose variances are then known to (2/n)^0.5 = 1
    # %
    left = 20_000
    for rows in sorted(parts, key=len, reverse=True):
        middle = rows[max(0, len(rows) // 2 - left // 2) :][:left]
        if len(middle) > 3:
            yield middle
        left -= len(middle)
        if left <= 0:
            return


def roughness(q: Array, h: Array, period: float) -> Array:
    """Return sums of squared second differences: of samples counted evenly, and by stamps."""
    counted = np.diff(q, n=2, axis=0)
    step = np.maximum(h, 1e-3 * period)[:, None]
    slope = np.diff(q, axis=0) / step
    stamped = 2 * np.diff(slope, axis=0) / (step[1:] + step[:-1]) * period**2
    return np.array([np.sum(counted**2, axis=0), np.sum(stamped**2, axis=0)])


def distinct(time: Array, rows: Integers, period: float) -> Integers:
    """Return the rows without repetitions of the previous stamp."""
    apart = np.diff(time[rows]) > SAME_STAMP * period
    return np.asarray(rows[np.concatenate([[True], apart])])


def stretch_of(
    time: Array, rows: Integers, period: float, instants: Instants, *, trusted: bool = False
) -> Stretch:
    """Find the instants of rows without a gap."""
    if instants == "stamped":
        return Stretch(rows, time, period)
    # numbers of the samples in an even count, with missing ones; losses within a tick of a coarse
    # clock cannot be detected
    steps, passed = np.ones(len(time) - 1, dtype=np.int64), np.diff(time)
    tick = float(np.median(passed[passed > SAME_STAMP * period]))
    wide = np.flatnonzero(passed > 1.5 * max(period, tick))
    steps[wide] += np.rint(lost(time, wide, period) / period).astype(np.int64).clip(0)
    slots = np.zeros(len(time), dtype=np.int64)
    np.cumsum(steps, out=slots[1:])
    if trusted:
        slots = np.rint((time - time[0]) / period).astype(np.int64)
    if instants == "even":
        return Stretch(rows, time[0] + period * slots, period)
    own, begin = _line(slots, time, period)
    return Stretch(rows, np.asarray(begin + own * slots, dtype=np.float64), own)


def _line(slots: Integers, time: Array, period: float) -> tuple[float, float]:
    """Fit slope and start of even instants to the least late stamps [s]."""
    if len(slots) < 3 * WINDOW:
        return float((time[-1] - time[0]) / slots[-1]), float(time[0])
    late = time - period * slots
    parts = np.array_split(np.arange(len(slots)), len(slots) // WINDOW)
    least = np.array([part[np.argmin(late[part])] for part in parts])
    columns = np.stack([slots[least], np.ones(len(least))], axis=1)
    slope, begin = np.linalg.lstsq(columns, time[least] - time[0], rcond=None)[0]
    return float(slope), float(begin + time[0])


def resampled(instants: Array, values: Array, grid: Array) -> Array:
    """Interpolate values at the instants of a grid.

    Cubics between samples take values and slopes from both sides; the slope at a sample is that of
    the parabola through three neighbouring samples. So parabolas are reproduced, samples on the
    grid are unchanged, and the influence of a sample ends at the second neighbour.

    Parameters
    ----------
    instants : array (n,)
        Rising instants, at least two [s].
    values : array (n, k)
    grid : array (m,)
        Instants of the result [s]; outside of `instants` the end values are used.

    Returns
    -------
    array (m, k)
    """
    interval = np.clip(np.searchsorted(instants, grid, side="right") - 1, 0, len(instants) - 2)
    h = np.diff(instants)[interval]
    u = np.clip((grid - instants[interval]) / h, 0.0, 1.0)
    slopes: Array = np.gradient(values, instants, axis=0, edge_order=2 if len(instants) > 2 else 1)
    before, after = ((values[at], slopes[at] * h[:, None]) for at in (interval, interval + 1))
    u = u[:, None]
    return np.asarray(
        (1 + 2 * u) * (1 - u) ** 2 * before[0]
        + u * (1 - u) ** 2 * before[1]
        + u**2 * (3 - 2 * u) * after[0]
        - u**2 * (1 - u) * after[1]
    )
