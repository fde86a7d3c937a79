"""Segments of a recording, and the motions within.

Rows or times stated in a map, and files with restarted stamps, make segments; gaps split these into
stretches (`stamps`), and long stretches are cut into motions of at most a minute, since motions
pass through memory one at a time. Motions have blocks of some seconds, for changing friction.

For an axis moving back and forth alone, strokes are found in its positions. The axis moves where it
is faster than a twentieth of its full speed; motions in one direction without a reversal are one
stroke. Strokes shorter than a fifth of the longest are ignored. Even strokes go forward, odd ones
back; rest, and the motion before the first stroke forward, have no number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.held import RARE, SLOW
from hil.imports.instants import resampled
from hil.imports.row_count import increments
from hil.runs.recording import IDLE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Integers, Numbers
    from hil.imports.instants import Stretch
    from hil.imports.map_file import MapFile
    from hil.imports.samples import Samples

    Pair = tuple[tuple[int, int], tuple[int, int]]
    """First sample and sample after the last of a stroke forward, and of the stroke back."""

LONGEST = 60.0
"""Maximum duration of a motion [s]."""
FAR, FARTHER = 3.0, 10.0
"""Minimum ratios of a jump to the steps around it, and to an increment: ten rows and more are
missing, in which another joint may change its speed. Between rows speeds change less."""
SHORTEST = 1.0
"""Minimum duration of a motion, and of a block [s]."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Motion without a gap.

    Attributes
    ----------
    stretch : Stretch
        Stretch with the motion.
    first, n : int
        First sample on the even grid of the stretch, and number of samples.
    """

    stretch: Stretch
    first: int
    n: int

    @property
    def duration(self) -> float:
        """Duration from the first to the last sample [s]."""
        return (self.n - 1) * self.stretch.period

    @property
    def grid(self) -> Array:
        """Instants of the samples [s]."""
        stretch = self.stretch
        at = np.arange(self.first, self.first + self.n)
        return np.asarray(stretch.instants[0] + at * stretch.period)


def chosen_rows(the_map: MapFile, samples: Samples) -> list[Integers]:
    """Return the rows of all segments, from 0.

    Raises
    ------
    FileError
        Rows or times beyond the recording.
    """
    n = len(samples.time)
    parts = [np.arange(n)]
    if (stated := the_map.content.rows) is not None:
        if stated[-1][1] > n:
            raise the_map.wrong(
                ("rows",), f"row {stated[-1][1]} must be at most {n}, the last row of the recording"
            )
        parts = [np.arange(first - 1, last) for first, last in stated]
    elif the_map.content.time_range is not None:
        parts = list(_within_times(the_map, samples))
    stamped = the_map.content.time is None or the_map.content.time.rate is None
    return [part for rows in parts for part in _split_files(samples, rows, stamped=stamped)]


def _within_times(the_map: MapFile, samples: Samples) -> Iterator[Integers]:
    time = samples.time
    for number, (begin, end) in enumerate(the_map.content.time_range or ()):
        rows = np.flatnonzero((time >= begin) & (time <= end))
        if len(rows) < 2:
            counted = ", counted from its first stamp" if samples.from_date else ""
            raise the_map.wrong(
                ("time_range", number),
                f"[{begin:g}, {end:g}] s has no samples; the recording has times from"
                f" {np.nanmin(time):.6g} to {np.nanmax(time):.6g} s{counted}",
            )
        yield rows


def split_at_jumps(samples: Samples, segments: Sequence[Integers]) -> list[Integers]:
    """Split segments where all moving joints jump at once: rows are missing there.

    Without stamps, a stated rate counts the rows present. At a jump the step of a joint is
    `FARTHER` than those around it, and that of another moving joint `FAR`. A spike has two such
    steps, and a slip or another zero of an encoder concerns one joint.
    """
    found: list[Integers] = []
    for rows in segments:
        q = np.asfortranarray(samples.read(rows)[:, : samples.n_joints])
        size, joints = max(len(q) - 1, 0), 0
        far, farther = np.zeros(size, dtype=np.intp), np.zeros(size, dtype=bool)
        for x in q.T:
            step = np.abs(np.diff(x))
            joints += bool(step.any())
            at, around = _far(x, step)
            far[at] += 1
            farther[at] |= step[at] > FARTHER * around
        jumps = np.flatnonzero(farther & (far >= min(joints, 2)))
        found += np.split(rows, jumps + 1) if len(jumps) < RARE * len(rows) else [rows]
    return found


def _far(x: Array, pace: Array) -> tuple[Integers, Array]:
    """Return steps that are `FAR` beyond those around, and those, at the pace of a period."""
    # two steps on either side, since rows may repeat
    around = np.max([pace[:-4], pace[1:-3], pace[3:-1], pace[4:]], axis=0)
    at = np.flatnonzero(pace[2:-2] > FAR * around)
    if len(at):
        # a change of steps that is ordinary in the motion, as where it begins, is no jump; neither
        # are increments of an encoder, or of significant digits
        step = np.abs(np.diff(x))
        at = at[step[at + 2] > FAR * np.quantile(np.abs(np.diff(step)), 1 - RARE)]
    if len(at):  # increments take long
        at = at[step[at + 2] > FARTHER * increments(x, at + 2)]
    return at + 2, around[at]


def jumps_of(x: Array, instants: Array, period: float) -> Integers:
    """Return the rows before jumps of a joint that no motion explains, from 0.

    A jump is `FARTHER` than the steps around it, and than ordinary steps of the moving joint; where
    samples are missing, steps count at the pace of a period.
    """
    pace = np.abs(np.diff(x)) * period / np.maximum(np.diff(instants), period)
    if pace.max(initial=0.0) <= FARTHER * pace.mean():  # the usual case, found at once
        return np.zeros(0, dtype=np.intp)
    at, around = _far(x, pace)
    at = at[pace[at] > FARTHER * around]
    usual = FARTHER * np.quantile(pace[pace > 0], 1 - RARE) if len(at) else 0.0
    return np.asarray(at[pace[at] > usual])


def _split_files(samples: Samples, rows: Integers, *, stamped: bool) -> list[Integers]:
    """Split rows at files and repeated headers with restarted stamps."""
    cuts = []
    for begin in (*samples.begins[1:], *(row + 1 for row in samples.restarts)):
        at = int(np.searchsorted(rows, begin))
        if 0 < at < len(rows):
            before = samples.time[rows[:at]]
            goes_on = stamped and samples.time[rows[at]] > before[np.isfinite(before)][-1:]
            cuts += [] if goes_on else [at]
    return np.split(rows, sorted(cuts))


def pieces_of(stretch: Stretch) -> list[Piece]:
    """Cut a stretch into motions of about equal length; return no motion for a short stretch."""
    n = math.floor(stretch.duration / stretch.period + 1e-6) + 1
    if (n - 1) * stretch.period < SHORTEST * (1 - 1e-6):
        return []
    parts = math.ceil((n - 1) * stretch.period / LONGEST - 1e-6)
    edges = np.linspace(0, n, parts + 1).round().astype(int).tolist()
    return [Piece(stretch, a, b - a) for a, b in pairwise(edges)]


def block_counts(durations: Sequence[float]) -> list[int]:
    """Return the number of blocks of all motions of a recording, from durations [s]."""
    # blocks last at most 30 s; a whole recording has at least 8, if blocks of `SHORTEST` permit
    longest = min(30.0, max(SHORTEST, sum(durations) / 8))
    return [
        max(1, min(math.ceil(duration / longest - 1e-6), math.floor(duration / SHORTEST + 1e-6)))
        for duration in durations
    ]


def blocks(n: int, count: int) -> Numbers:
    """Return the block number of `n` samples."""
    return np.asarray(np.arange(n) * count // n, dtype=np.int16)


def strokes_of(q: Array, period: float) -> list[tuple[int, int, bool]]:
    """Return strokes as first sample, sample after the last, and True for forward.

    Parameters
    ----------
    q : array (n,)
        Positions every `period` [rad or m].
    period : float
        Sampling period [s].
    """
    # speeds are means over 0.02 s, because encoders may be coarse
    half = max(1, round(0.02 / period / 2))
    speed = np.zeros(len(q))
    speed[half:-half] = (q[2 * half :] - q[: -2 * half]) / (2 * half * period)
    direction = np.where(np.abs(speed) > SLOW * np.max(np.abs(speed)), np.sign(speed), 0)
    merged: list[list[int]] = []
    edges = [0, *(np.flatnonzero(np.diff(direction)) + 1).tolist(), len(direction)]
    for begin, end in pairwise(edges):
        if not (sign := int(direction[begin])):
            continue
        if merged and merged[-1][2] == sign:
            merged[-1][1] = end
        else:
            merged.append([begin, end, sign])
    ways = [abs(q[end - 1] - q[begin]) for begin, end, _ in merged]
    longest = max(ways, default=0.0)
    return [
        (begin, end, sign > 0)
        for (begin, end, sign), way in zip(merged, ways, strict=True)
        if way > 0.2 * longest
    ]


def pairs_of(q: Array, period: float) -> list[Pair]:
    """Return pairs of a stroke forward and the following stroke back."""
    strokes = strokes_of(q, period)
    return [(forth[:2], back[:2]) for forth, back in pairwise(strokes) if forth[2] and not back[2]]


def pieces_by_pairs(samples: Samples, stretch: Stretch, axis: int) -> list[tuple[Piece, Numbers]]:
    """Cut a stretch into motions of whole pairs, with the stroke number of all samples.

    Parameters
    ----------
    axis : int
        Moving axis, from 0.
    """
    n = math.floor(stretch.duration / stretch.period + 1e-6) + 1
    grid = stretch.instants[0] + np.arange(n) * stretch.period
    position = samples.read(stretch.rows)[:, axis]
    q = resampled(stretch.instants, position[:, None], grid)[:, 0]
    if n * stretch.period < SHORTEST:
        return []
    groups = _grouped(pairs_of(q, stretch.period), round(LONGEST / stretch.period))
    edges = [0, *(group[0][0][0] for group in groups[1:]), n]
    longest = round(LONGEST / stretch.period)
    found = []
    for group, (begin, end) in zip(groups, pairwise(edges), strict=True):
        first, last = max(begin, group[-1][1][1] - longest), group[-1][1][1]
        last = min(end, max(last, first + longest))
        found.append((Piece(stretch, first, last - first), _numbers(group, first, last)))
    return found


def _grouped(pairs: list[Pair], longest: int) -> list[list[Pair]]:
    """Group consecutive pairs that last no longer than `longest` samples."""
    groups: list[list[Pair]] = []
    for pair in pairs:
        if groups and pair[1][1] - groups[-1][0][0][0] <= longest:
            groups[-1].append(pair)
        else:
            groups.append([pair])
    return groups


def _numbers(group: list[Pair], first: int, last: int) -> Numbers:
    numbers = np.full(last - first, IDLE, dtype=np.int16)
    for index, (forth, back) in enumerate(group):
        for stroke, (begin, end) in ((2 * index, forth), (2 * index + 1, back)):
            numbers[max(begin, first) - first : max(end, first) - first] = stroke
    return numbers
