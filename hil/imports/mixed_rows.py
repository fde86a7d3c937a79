"""Detection of two sources in one recording: two publishers on a topic, or merged files.

Each source is smooth, and the mixture is not. For alternating rows the second differences of every
second row are small, and those of all rows are twice the distance of the sources. A row of a rarer
source is far from both neighbouring rows, which are close to one another. Unlike spikes, the rows
of the rarer source are also close to one another.

The encoder of a joint at rest toggles: by the bound of `hil.imports.spikes`, neighbouring samples
of one source differ by up to two increments. Sources differ by more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.imports.evidence import Suspicion
from hil.imports.held import rows_held
from hil.imports.instants import roughness
from hil.imports.tables import ROWS
from hil.least_squares.standstill import increment

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.samples import Samples

ALTERNATING = 3.0
"""Minimum ratio of second differences, all rows over every second row, for alternating rows.

White noise has 1, smoother signals less.
"""
RETURNED = 0.2
"""Maximum distance between both neighbours of a row, as a share of their distance from the row."""
FAR = 0.05
"""Minimum distance of a row of another source, as a share of the range of half of the joints."""
OFTEN = 0.02
"""Minimum share of rows of another source: 1 in 50, as 2 Hz among 100 Hz."""
_ENOUGH = 50
"""Minimum number of rows."""
GREATEST = 1e100
"""Maximum value with a finite sum of squares."""


class _Mixed(NamedTuple):
    """Rows of a second source: number, first row, and distance from the first source."""

    rows: int
    first: int
    distance: Array


def source_suspicions(samples: Samples, segments: Sequence[Integers]) -> Iterator[Suspicion]:
    """Yield a suspicion where the rows of two sources are mixed."""
    for segment in segments:
        rows = segment[samples.complete[segment]]
        for begin in range(0, len(rows), ROWS):
            part = rows[begin : begin + ROWS]
            if len(part) < _ENOUGH:
                continue
            q = np.asfortranarray(samples.recorded(part)[:, : samples.n_joints])
            np.clip(q, -GREATEST, GREATEST, out=q)
            if (mixed := _visits(q) or _alternating(q, samples.time[part])) is not None:
                yield _suspicion(samples, part, mixed)
                return


def _suspicion(samples: Samples, rows: Integers, mixed: _Mixed) -> Suspicion:
    row = int(rows[mixed.first])
    file = int(np.searchsorted(samples.begins, row, side="right")) - 1
    joint = int(np.argmax(mixed.distance))
    return Suspicion(
        "spikes",
        ("files", file),
        f"rows alternate between two sources: {mixed.rows} of {len(rows)} rows, the first in row "
        f"{row - samples.begins[file] + 1}, differ from their neighbours by "
        f"{mixed.distance[joint]:.3g} rad or m of joint {joint + 1} and form a smooth signal of "
        "their own, like two publishers on one topic, commanded and measured states, or two "
        "merged files; record or export only one source",
    )


def _visits(q: Array) -> _Mixed | None:
    """Find rows of a rarer second source."""
    steps, ranges = np.abs(np.diff(q, axis=0)), np.ptp(q, axis=0)
    far = steps.max(axis=0) > FAR * ranges  # usually no step of any joint
    if np.count_nonzero((steps[:, far] > FAR * ranges[far]).any(axis=1)) < OFTEN * len(q):
        return None
    away, gap = np.minimum(steps[:-1], steps[1:]), np.abs(q[2:] - q[:-2])
    far = (away > FAR * ranges) & (gap < RETURNED * away)
    # increments of a part are no smaller, and sorting takes long
    least = _toggles(q[::16])
    if np.count_nonzero(_visiting(far, (ranges > least) & (least > 0))) < OFTEN * len(q):
        return None
    toggles = _toggles(q)
    visiting = _visiting(far & (away > toggles), ranges > toggles)
    rows = 1 + np.flatnonzero(visiting)
    if len(rows) < max(OFTEN * len(q), 3):
        return None
    distance: Array = np.median(away[visiting], axis=0)
    if _smooth(q[rows], distance):
        return _Mixed(len(rows), int(rows[0]), distance)
    return None


def _visiting(far: Mask, varying: Mask) -> Mask:
    """Return the rows in which half of the varying joints are far, and one at least."""
    return np.asarray((far.mean(axis=1) >= min(0.5, 0.5 * varying.mean())) & far.any(axis=1))


def _toggles(q: Array) -> Array:
    """Return the greatest difference of neighbouring samples by rounding, shape (n_joints,)."""
    return (2.0 + 1e-6) * np.array([increment(x) for x in q.T])


def _smooth(q: Array, distance: Array) -> bool:
    """Return True if rows of a second source form a smooth signal."""
    # if two sources alternate, every second row is of the same source
    nearest = np.minimum(np.abs(q[1:-1] - q[:-2]), np.abs(q[2:] - q[:-2]))
    away = distance > 0
    return bool(away.any() and (np.median(nearest, axis=0) < RETURNED * distance)[away].all())


def _alternating(q: Array, time: Array) -> _Mixed | None:
    """Find two sources in turn with nearly equal positions."""
    ranges = np.ptp(q, axis=0)
    moves = ranges > FAR * ranges.max()
    distance = np.zeros(len(ranges))
    for joint in np.flatnonzero(moves):
        x = q[:, [joint]]
        every = _least(x, time)
        second = (_least(x[::2], time[::2]) + _least(x[1::2], time[1::2])) / 2
        if not every > ALTERNATING * second or rows_held(q[:, joint]) > 1:
            return None
        distance[joint] = every / 2
    return _Mixed(len(q) // 2, 1, distance) if moves.any() else None


def _least(q: Array, time: Array) -> float:
    """Return the rms second difference, by row number or by stamps, whichever is smaller."""
    period = float(np.median(np.diff(time)))
    if not period > 0:
        period = 1.0
        time = np.arange(len(time), dtype=np.float64)
    squares = roughness(q, np.diff(time), period)
    return float(np.sqrt(squares.min() / max(1, len(q) - 2)))
