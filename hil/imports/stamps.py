"""Time stamps: what of a recording is without a gap, and at which instants it was sampled.

The period is the middle one of the mean periods of fifty samples each, so that neither stamps in
bursts nor gaps nor a coarse clock decide it. Rows without a number, and rows that repeat the row
before, are left out and counted. Where more than `GAP` passes between two rows, and later
rows do not make up for it, samples are missing and the recording is split; a stall of the recorder
after which rows come in a burst is none.

Instants are the stamps themselves, or even ones by counting the samples: whichever makes the
positions smoother. A recorder that polls is late at sampling, and its stamps are right; one that
stamps what arrives is late at stamping, and the count is right. Where more than a twentieth of the
rows bear the stamp of another one, the clock is coarse, and the count is right as well.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from hil.imports.samples import Samples

    Array = NDArray[np.float64]
    Rows = NDArray[np.int64]

GAP = 0.02
"""Longest time between two rows that is bridged [s]; 2.5 periods where these are longer."""
GAP_PERIODS = 2.5
EVEN = 0.01
"""Deviation from the period that counts as none, as share of it."""
_WINDOW = 50
_DISORDER = 0.01
_SAME_STAMP = 1e-6
_COARSE = 0.05
_COMPARED = 20_000

Instants = Literal["even", "counted", "stamped"]


class WrongStamps(Exception):
    """Stamps that no recording can have; the message states the row."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a recording without a gap.

    Attributes
    ----------
    rows : array (n,) of int
        Rows of the samples, in the order of time.
    instants : array (n,)
        When they were sampled, rising [s].
    period : float
        Of an even grid for them [s].
    """

    rows: Rows
    instants: Array
    period: float

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return float(self.instants[-1] - self.instants[0])


@dataclass
class Counts:
    """What was found of time stamps.

    Attributes
    ----------
    rows, missing, doubled, disordered : int
        Rows chosen; without a number; with the stamp of another one; sorted back into order.
    gaps : int
        Where samples are missing for longer than is bridged.
    lost : float
        Time within gaps [s].
    bridged : int
        Samples that were interpolated over less.
    short : int
        Stretches left out for being too short, of `short_time` [s] altogether.
    jitter : float
        Standard deviation of the time between samples [s].
    """

    rows: int = 0
    missing: int = 0
    doubled: int = 0
    disordered: int = 0
    gaps: int = 0
    lost: float = 0.0
    bridged: int = 0
    short: int = 0
    short_time: float = 0.0
    jitter: float = 0.0


@dataclass
class Timing:
    """Stretches of a recording, the longest one's period [s], whence instants are, and counts."""

    stretches: list[Stretch]
    period: float
    instants: Instants
    counts: Counts = field(default_factory=Counts)


def timing_of(samples: Samples, segments: list[Rows], *, trusted: bool = False) -> Timing:
    """Find stretches and instants.

    Parameters
    ----------
    samples : Samples
    segments : list of arrays of int
        Rows that were chosen, in parts that have nothing to do with each other.
    trusted : bool
        Whether stamps come from a stated rate.

    Raises
    ------
    WrongStamps
        Time runs backwards, or does not pass.
    """
    counts = Counts(rows=sum(map(len, segments)))
    usable = [_usable(samples, rows, counts) for rows in segments]
    usable = [rows for rows in usable if len(rows) > 1]
    if not usable:
        raise WrongStamps("no two rows with all columns present; choose other columns or rows")
    period = _period([samples.time[rows] for rows in usable])
    if not period > 0:
        raise WrongStamps("time does not pass; choose another column of time, or state its rate")
    ordered = [_ordered(samples, rows, period, counts) for rows in usable]
    ordered = [_without_repeats(samples, rows, counts) for rows in ordered]
    parts = [part for rows in ordered for part in _split(samples.time[rows], rows, period, counts)]
    parts = [part for part in parts if len(part) > 1]
    _note_jitter([samples.time[rows] for rows in parts], period, counts)
    instants: Instants = "even" if trusted else _instants(samples, parts, period)
    stretches = []
    for rows in parts:
        kept = rows if instants != "stamped" else _distinct(samples.time, rows, period)
        if len(kept) > 1:
            stretches.append(_stretch(samples.time[kept], kept, period, instants, counts))
    longest = max(stretches, key=lambda stretch: len(stretch.rows))
    return Timing(stretches, longest.period, instants, counts)


def _usable(samples: Samples, rows: Rows, counts: Counts) -> Rows:
    complete = samples.complete[rows]
    counts.missing += int(np.count_nonzero(~complete))
    return rows[complete]


def _period(times: list[Array]) -> float:
    """Middle of the mean periods of some samples each; the middle period itself where near it."""
    means = np.concatenate(
        [(t[_WINDOW::25] - t[:-_WINDOW:25]) / _WINDOW for t in times if len(t) > _WINDOW]
        or [np.diff(t) for t in times]
    )
    mean = float(np.median(means))
    middle = float(np.median(np.concatenate([np.diff(t) for t in times])))
    return middle if abs(middle - mean) < 0.05 * mean else mean


def _ordered(samples: Samples, rows: Rows, period: float, counts: Counts) -> Rows:
    """Rows in the order of time.

    Raises
    ------
    WrongStamps
        Time runs back by more than a few samples, or often.
    """
    time = samples.time[rows]
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0)
    if not len(back):
        return rows
    worst = int(back[np.argmin(steps[back])])
    if steps[worst] < -10 * period or len(back) > max(1, _DISORDER * len(rows)):
        raise WrongStamps(
            f"time runs backwards at {len(back)} of {len(rows)} rows, from {time[worst]:.6g} s to"
            f" {time[worst + 1]:.6g} s at row {rows[worst + 1] + 1}; choose another column of time,"
            " or end a segment there with rows"
        )
    counts.disordered += len(back)
    return rows[np.argsort(time, kind="stable")]


def _without_repeats(samples: Samples, rows: Rows, counts: Counts) -> Rows:
    """Rows without those that repeat the row before, stamp and values."""
    same = np.flatnonzero(np.diff(samples.time[rows]) == 0)
    equal = np.array(
        [np.array_equal(*samples.values[rows[at : at + 2]], equal_nan=True) for at in same], bool
    )
    counts.doubled += int(np.count_nonzero(equal))
    return np.delete(rows, same[equal] + 1)


def _split(time: Array, rows: Rows, period: float, counts: Counts) -> Iterator[Rows]:
    """Split rows where samples are missing for longer than is bridged."""
    longest = max(GAP, GAP_PERIODS * period)
    wide = np.flatnonzero(np.diff(time) > longest)
    cuts = [int(at) + 1 for at in wide if _lost(time, int(at), period) > longest - period]
    counts.gaps += len(cuts)
    counts.lost += float(sum(time[cut] - time[cut - 1] - period for cut in cuts))
    yield from np.split(rows, cuts)


def _lost(time: Array, at: int, period: float) -> float:
    """Time that is missing between two samples: later ones do not make up for it [s].

    Stamps may be late, never early: the least late ones before and after state the time that passed
    for the samples in between.
    """
    reach = int(min((time[at + 1] - time[at]) / period, len(time))) + 7
    before, after = np.arange(max(0, at + 1 - reach), at + 1), np.arange(at + 1, at + 1 + reach)
    after = after[after < len(time)]
    late = lambda these: float(np.min(time[these] - these * period))  # noqa: E731
    return late(after) - late(before)


def _note_jitter(times: list[Array], period: float, counts: Counts) -> None:
    steps = np.concatenate([np.diff(t) for t in times]) if times else np.zeros(1)
    counts.jitter = round(float(np.std(steps)), 9)
    counts.doubled += int(np.count_nonzero(steps <= _SAME_STAMP * period))


def _instants(samples: Samples, parts: list[Rows], period: float) -> Instants:
    """Whether instants are even anyway, or better counted than taken from the stamps."""
    steps = [np.diff(samples.time[rows]) for rows in parts]
    if all(np.all(np.abs(s - period) < EVEN * period) for s in steps):
        return "even"
    every = np.concatenate(steps)
    if np.mean(every <= _SAME_STAMP * period) > _COARSE:
        return "counted"
    rough = np.zeros((2, samples.n_joints))
    for rows in _some_of(parts):
        q, h = samples.values[rows, : samples.n_joints], np.diff(samples.time[rows])
        rough += _roughness(q, h, period)
    some = rough.min(axis=0) > 0
    counted_is_smoother = np.sum(np.log(rough[0, some] / rough[1, some])) < 0
    return "counted" if counted_is_smoother else "stamped"


def _some_of(parts: list[Rows]) -> Iterator[Rows]:
    left = _COMPARED
    for rows in sorted(parts, key=len, reverse=True):
        middle = rows[max(0, len(rows) // 2 - left // 2) :][:left]
        if len(middle) > 3:
            yield middle
        left -= len(middle)
        if left <= 0:
            return


def _roughness(q: Array, h: Array, period: float) -> Array:
    """Sums of squared second differences: of evenly counted samples, and by their stamps."""
    counted = np.diff(q, n=2, axis=0)
    step = np.maximum(h, 1e-3 * period)[:, None]
    slope = np.diff(q, axis=0) / step
    stamped = 2 * np.diff(slope, axis=0) / (step[1:] + step[:-1]) * period**2
    return np.array([np.sum(counted**2, axis=0), np.sum(stamped**2, axis=0)])


def _distinct(time: Array, rows: Rows, period: float) -> Rows:
    """Rows without those that bear the stamp of the row before."""
    apart = np.diff(time[rows]) > _SAME_STAMP * period
    return rows[np.concatenate([[True], apart])]


def _stretch(time: Array, rows: Rows, period: float, instants: Instants, counts: Counts) -> Stretch:
    if instants == "stamped":
        counts.bridged += int(np.sum(np.maximum(np.rint(np.diff(time) / period) - 1, 0)))
        return Stretch(rows, time, period)
    slots = _slots(time, period)
    counts.bridged += int(slots[-1]) + 1 - len(slots)
    if instants == "even":
        return Stretch(rows, time[0] + period * slots, period)
    own, begin = _line(slots, time, period)
    return Stretch(rows, begin + own * slots, own)


def _line(slots: NDArray[np.int64], time: Array, period: float) -> tuple[float, float]:
    """Slope and begin of even instants, by the least late stamps here and there [s]."""
    if len(slots) < 3 * _WINDOW:
        return float((time[-1] - time[0]) / slots[-1]), float(time[0])
    late = time - period * slots
    parts = np.array_split(np.arange(len(slots)), len(slots) // _WINDOW)
    least = np.array([part[np.argmin(late[part])] for part in parts])
    slope, begin = np.polyfit(slots[least], time[least], 1)
    return float(slope), float(begin)


def _slots(time: Array, period: float) -> NDArray[np.int64]:
    """Number of each sample in an even count that goes on where samples are missing.

    What is lost within a tick of a coarse clock cannot be seen.
    """
    steps, passed = np.ones(len(time) - 1, dtype=np.int64), np.diff(time)
    tick = float(np.median(passed[passed > _SAME_STAMP * period]))
    for at in np.flatnonzero(passed > 1.5 * max(period, tick)):
        steps[at] += max(0, round(_lost(time, int(at), period) / period))
    return np.asarray(np.concatenate([[0], np.cumsum(steps)]), dtype=np.int64)
