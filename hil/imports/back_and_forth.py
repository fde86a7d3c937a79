"""Strokes of an axis that moves back and forth by itself, found in its positions.

The axis is under way where it is faster than a twentieth of its full speed; ways in one direction
without a turn between them are one stroke. A stroke that is shorter than a fifth of the longest one
is none. Even strokes go forward, odd ones back; what is at rest, or is the way to the first stroke
forward, has no number.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.resampling import resampled
from hil.imports.segments import LONGEST, SHORTEST, Piece
from hil.runs.recording import IDLE

if TYPE_CHECKING:
    from hil.arrays import Array, Numbers
    from hil.imports.instants import Stretch
    from hil.imports.samples import Samples


UNDER_WAY = 0.05
"""Speed from which on the axis is under way, as share of its greatest."""
_SHORT = 0.2
_MEAN_OVER = 0.02


def strokes_of(q: Array, period: float) -> list[tuple[int, int, bool]]:
    """Strokes as first sample, sample after the last, and whether they go forward.

    Parameters
    ----------
    q : array (n,)
        Positions every `period` [rad or m].
    period : float
        [s].
    """
    half = max(1, round(_MEAN_OVER / period / 2))
    speed = np.zeros(len(q))
    speed[half:-half] = (q[2 * half :] - q[: -2 * half]) / (2 * half * period)
    direction = np.where(np.abs(speed) > UNDER_WAY * np.max(np.abs(speed)), np.sign(speed), 0)
    runs = _runs(direction)
    merged: list[list[int]] = []
    for begin, end, sign in runs:
        if merged and merged[-1][2] == sign:
            merged[-1][1] = end
        else:
            merged.append([begin, end, sign])
    ways = [abs(q[end - 1] - q[begin]) for begin, end, _ in merged]
    longest = max(ways, default=0.0)
    return [
        (begin, end, sign > 0)
        for (begin, end, sign), way in zip(merged, ways, strict=True)
        if way > _SHORT * longest
    ]


def _runs(direction: Array) -> list[tuple[int, int, int]]:
    edges = np.flatnonzero(np.diff(direction)) + 1
    begins, ends = np.concatenate([[0], edges]), np.concatenate([edges, [len(direction)]])
    return [
        (int(begin), int(end), int(direction[begin]))
        for begin, end in zip(begins, ends, strict=True)
        if direction[begin]
    ]


def pairs_of(q: Array, period: float) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Strokes forward, each with the stroke back that follows it."""
    strokes = strokes_of(q, period)
    return [(forth[:2], back[:2]) for forth, back in pairwise(strokes) if forth[2] and not back[2]]


def pieces_by_pairs(samples: Samples, stretch: Stretch, axis: int) -> list[tuple[Piece, Numbers]]:
    """Cut a stretch into motions of whole pairs, with the stroke of each sample.

    Parameters
    ----------
    axis : int
        That moves, from 0.
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


def _grouped(
    pairs: list[tuple[tuple[int, int], tuple[int, int]]], longest: int
) -> list[list[tuple[tuple[int, int], tuple[int, int]]]]:
    """Groups of pairs that follow each other and last no longer than `longest` samples."""
    groups: list[list[tuple[tuple[int, int], tuple[int, int]]]] = []
    for pair in pairs:
        if groups and pair[1][1] - groups[-1][0][0][0] <= longest:
            groups[-1].append(pair)
        else:
            groups.append([pair])
    return groups


def _numbers(
    group: list[tuple[tuple[int, int], tuple[int, int]]], first: int, last: int
) -> Numbers:
    numbers = np.full(last - first, IDLE, dtype=np.int16)
    for index, (forth, back) in enumerate(group):
        for stroke, (begin, end) in ((2 * index, forth), (2 * index + 1, back)):
            numbers[max(begin, first) - first : max(end, first) - first] = stroke
    return numbers
