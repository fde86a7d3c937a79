"""Time stamps: order and period of samples, and gaps.

The period is the median of mean periods over fifty samples, independent of bursts of stamps, gaps
and a coarse clock. Rows without a number, repetitions of the row before, and rows with held values
are left out and counted. Where more than 20 ms, or 2.5 periods if longer, pass between two rows
without compensation by later rows, samples are missing and the recording is split; a stall of the
recorder followed by a burst of rows is no gap.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.held import held_of, measured
from hil.imports.instants import (
    EVEN,
    SAME_STAMP,
    WINDOW,
    Instants,
    Stretch,
    distinct,
    instants_of,
    lost,
    stretch_of,
)
from hil.imports.row_count import BRIDGED, RowCount, repeats_before
from hil.imports.tables import ROWS, SECONDS
from hil.least_squares.standstill import increment

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Integers
    from hil.imports.samples import Samples


class WrongStamps(Exception):
    """Impossible time stamps; the message states the row."""


@dataclass
class Counts:
    """Counts of faults in time stamps.

    Attributes
    ----------
    rows, missing, doubled, disordered : int
        Numbers of rows: chosen, without a number, with a repeated stamp, and reordered.
    gaps : int
        Number of stretches of missing samples too long for interpolation.
    lost : float
        Time within gaps [s].
    bridged : int
        Number of samples interpolated over shorter gaps.
    short : int
        Number of stretches that are too short, with `short_time` [s] in total.
    repeating, first_repeating : int
        Number of rows that repeat all values of the previous row, and the first one, from 1.
    at_rate : RowCount
        Rows written twice and rows missing at a stated rate.
    held : int
        Number of rows over which positions are held.
    repeated : int
        Number of skipped rows with repeated positions.
    jitter : float
        Standard deviation of the time between samples [s].
    """

    rows: int = 0
    missing: int = 0
    doubled: int = 0
    disordered: int = 0
    repeating: int = 0
    first_repeating: int = 0
    at_rate: RowCount = field(default_factory=RowCount)
    gaps: int = 0
    lost: float = 0.0
    bridged: int = 0
    short: int = 0
    short_time: float = 0.0
    held: int = 1
    repeated: int = 0
    jitter: float = 0.0


@dataclass
class Timing:
    """Stretches of a recording, period of the longest [s], kind of instants, and counts."""

    stretches: list[Stretch]
    period: float
    instants: Instants
    counts: Counts = field(default_factory=Counts)


def timing_of(samples: Samples, segments: list[Integers], rate: float | None = None) -> Timing:
    """Find stretches and instants.

    Parameters
    ----------
    segments : list of arrays of int
        Chosen rows, in independent parts.
    rate : float, optional
        Stated rate that the stamps come from [Hz]; it remains, however many rows are missing.

    Raises
    ------
    WrongStamps
        Stamps run backwards, or are constant.
    """
    counts = Counts(rows=sum(map(len, segments)))
    usable = [rows[samples.complete[rows]] for rows in segments]
    counts.missing = counts.rows - sum(map(len, usable))
    usable = [rows for rows in usable if len(rows) > 1]
    if not usable:
        raise WrongStamps("no two rows with all columns present; choose other columns or rows")
    trusted = rate is not None
    period = 1.0 / rate if rate else _period([samples.time[rows] for rows in usable])
    if period < 0:
        raise WrongStamps("time runs backwards; choose another column of time, or reverse the rows")
    if not period > 0:
        raise WrongStamps(
            "time stamps do not increase; choose another column of time, or state its rate"
        )
    ordered = [_ordered(samples, rows, period, counts) for rows in usable]
    ordered = [_drop_repeats(samples, rows, counts) for rows in ordered]
    counts.held = held_of(samples, ordered)
    if counts.held > 1:
        published = sum(map(len, ordered))
        ordered = [measured(samples, rows, counts.held) for rows in ordered]
        counts.repeated = published - sum(map(len, ordered))
        period = _period([samples.time[rows] for rows in ordered])
        trusted = False  # the stated rate is that of the rows, not of the measurements
    ordered = [_drop_held(samples, rows, period, counts) for rows in ordered]
    parts = [
        part
        for rows in ordered
        for part in _split(samples.time[rows], rows, period, counts, trusted=trusted)
    ]
    parts = [part for part in parts if len(part) > 1]
    period = _refined([samples.time[rows] for rows in parts], period)
    _note_jitter([samples.time[rows] for rows in parts], period, counts)
    instants: Instants = "even" if trusted else instants_of(samples, parts, period)
    stretches = []
    for rows in parts:
        own = trusted or instants == "stamped"  # instants are the stamps, which may repeat
        kept = distinct(samples.time, rows, period) if own else rows
        if len(kept) > 1:
            stretches.append(
                stretch_of(samples.time[kept], kept, period, instants, trusted=trusted)
            )
    counts.bridged = sum(stretch.bridged for stretch in stretches)
    longest = max(stretches, key=lambda stretch: len(stretch.rows))
    return Timing(stretches, longest.period, instants, counts)


def even_rate(samples: Samples, segments: Sequence[Integers]) -> float | None:
    """Return the rate of equidistant stamps [Hz], which may be a count of rows; None for others."""
    times = [samples.time[rows] for rows in segments if len(rows) > 1]
    if not times or not np.isfinite(np.concatenate(times)).all():
        return None
    period = _period(times)
    even = all(np.all(np.abs(np.diff(t) - period) < EVEN * period) for t in times)
    return 1.0 / period if even else None


def _period(times: list[Array]) -> float:
    """Return the median of mean periods; the mean of the steps in the middle if close to it.

    Rounding of equidistant stamps to a tick leaves steps of two neighbouring counts of ticks.
    """
    means = np.concatenate(
        [(t[WINDOW::25] - t[:-WINDOW:25]) / WINDOW for t in times if len(t) > WINDOW]
        or [np.diff(t) for t in times]
    )
    mean = float(np.median(means))
    steps = np.concatenate([np.diff(t) for t in times])
    middle = float(np.partition(steps, len(steps) // 2)[len(steps) // 2])
    if abs(middle - mean) >= 0.05 * mean:
        return mean
    # sorting takes long, and a part of the steps shows the same tick
    tick = min(increment(steps[:50_000]), middle / 2)
    return float(np.mean(steps[np.abs(steps - middle) <= 1.5 * tick]))


def _refined(times: list[Array], period: float) -> float:
    """Return the mean of all steps close to the period, if most are; else of all steps."""
    steps = np.concatenate([np.diff(t) for t in times])
    about = np.abs(steps - period) < period / 2
    # the period is the mean of steps close to it, if nine in ten are
    mean = float(np.mean(steps[about] if np.mean(about) > 0.9 else steps))
    return mean if abs(mean - period) < EVEN * period else period


def _ordered(samples: Samples, rows: Integers, period: float, counts: Counts) -> Integers:
    """Return the rows in the order of time; refuse stamps that run far backwards, or often."""
    time = samples.time[rows]
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0)
    if not len(back):
        return rows
    worst = int(back[np.argmin(steps[back])])
    # up to 1 % of rows out of order are sorted; with more, a column is not time
    if steps[worst] < -10 * period or len(back) > max(1, 0.01 * len(rows)):
        raise WrongStamps(
            f"time runs backwards at {len(back)} of {len(rows)} rows, from {time[worst]:.6g} s to"
            f" {time[worst + 1]:.6g} s at row {rows[worst + 1] + 1}"
            f"{_wrapped(period - steps[worst], period)}; choose another column of time, or end a"
            " segment there with rows"
        )
    counts.disordered += len(back)
    return rows[np.argsort(time, kind="stable")]


DAY = 86400.0
"""Duration of a day [s]."""


def _wrapped(fall: float, period: float) -> str:
    """Return words for a fall of stamps by the range of a counter, a day or an hour, else none."""
    for unit, seconds in SECONDS.items():  # times as text are in ns, whatever the map states
        if abs(fall * SECONDS["ns"] / seconds - DAY) < 2.5 * period * SECONDS["ns"] / seconds:
            text = "" if unit == "ns" else " (of times as text, in ns: write unit: ns)"
            return f": the clock of the day passed midnight{text}, add 24 h from there on"
    if abs(fall - 3600.0) < 2.5 * period:
        return ": local time was set back by an hour, as in autumn; add 3600 s from there on"
    for bits in (16, 32):
        for unit, seconds in SECONDS.items():
            if abs(fall - 2.0**bits * seconds) < 2.5 * period:
                return (
                    f": a counter of {bits} bits in {unit} overflowed, add {2**bits} from there on"
                )
    return ""


def _drop_repeats(samples: Samples, rows: Integers, counts: Counts) -> Integers:
    """Return the rows without repetitions of the previous row, stamp and values."""
    second = np.flatnonzero(np.diff(samples.time[rows]) == 0) + 1
    repeats = [np.zeros(0, dtype=np.int64)]
    for begin in range(0, len(second), ROWS):
        some = second[begin : begin + ROWS]
        before, after = (np.nan_to_num(samples.values[rows[at]]) for at in (some - 1, some))
        repeats.append(some[(before == after).all(axis=1)])
    found = np.concatenate(repeats)
    counts.doubled += len(found)
    return np.delete(rows, found)


def _drop_held(samples: Samples, rows: Integers, period: float, counts: Counts) -> Integers:
    """Return the rows without held rows, which repeat all values of the previous row.

    Values held for less than a bridged gap, or 2.5 times the usual hold, are left out and
    interpolated like missing samples. At rest this makes no difference.
    """
    same = repeats_before(samples, rows)
    changes = np.flatnonzero(~same)
    if len(changes) == len(rows) or len(changes) < 2:
        return rows
    apart = np.diff(changes, append=len(rows))
    usual = float(np.median(apart))
    held = same & np.repeat(apart <= max(BRIDGED / period, 2.5 * usual), apart)
    found = np.flatnonzero(held)
    # fewer than one held row in a hundred are harmless, and coarse columns repeat as often by
    # chance
    if len(found) < 0.01 * len(rows):
        return rows
    counts.first_repeating = counts.first_repeating or int(rows[found[0]]) + 1
    counts.repeating += len(found)
    return np.delete(rows, found)


def _split(
    time: Array, rows: Integers, period: float, counts: Counts, *, trusted: bool
) -> Iterator[Integers]:
    """Split rows at gaps too long for interpolation."""
    longest = max(BRIDGED, 2.5 * period) * (1 + SAME_STAMP)
    wide = np.flatnonzero(np.diff(time) > longest)
    # stamps of a stated rate are never late
    missing = np.diff(time)[wide] - period if trusted else lost(time, wide, period)
    cuts = wide[missing > longest - period] + 1
    counts.gaps += len(cuts)
    counts.lost += float(np.sum(time[cuts] - time[cuts - 1] - period))
    yield from np.split(rows, cuts)


def _note_jitter(times: list[Array], period: float, counts: Counts) -> None:
    steps = np.concatenate([np.diff(t) for t in times]) if times else np.zeros(1)
    counts.jitter = round(float(np.std(steps)), 9)
    counts.doubled += int(np.count_nonzero(steps <= SAME_STAMP * period))
