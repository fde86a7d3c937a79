"""Number of rows at a stated rate: rows written twice, and rows missing.

A stated rate counts the rows, and positions tell where the count is wrong. The step of a joint
is compared with the median step nearby. After a row written twice the step is ordinary, but
twice as large after a held row in place of a sample. Where rows are missing, the steps
of the moving joints are an equal multiple of the steps nearby, though the speed before and after is
equal; a row that was sampled late has a short step after it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hil.imports.held import SHARE
from hil.imports.tables import ROWS
from hil.least_squares.standstill import increment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.samples import Samples

LONGEST = 10
"""Maximum ratio of a step to the steps nearby: above, rows are split there."""
NEAR = 4
"""Number of steps on either side with the ordinary step as their median."""
WHOLE = 0.25
"""Maximum difference of a ratio of steps from a whole number, half of a rounding."""
CLEAR = 3 / WHOLE
"""Minimum ratio of a step to the noise: three standard deviations are within `WHOLE`."""
INCREMENTS = 2 / WHOLE
"""Minimum ratio of a step to an increment: two steps rounded by half each are within `WHOLE`."""
BRIDGED = 0.02
"""Longest time without samples that is interpolated [s]: less than half a period of a robot's
fastest motion, at 20 Hz."""


@dataclass
class RowCount:
    """Rows written twice and rows missing, with the first row of each, from 1."""

    surplus: int = 0
    first_surplus: int = 0
    missing: int = 0
    first_missing: int = 0


def repeats_before(samples: Samples, rows: Integers) -> Mask:
    """Return a mask of the rows that repeat the values of the previous row."""
    same = np.zeros(len(rows), dtype=bool)
    for begin in range(1, len(rows), ROWS):
        values = samples.recorded(rows[begin - 1 : begin + ROWS])
        # rows with a change in one column are new, so other columns need no check
        alike = 1 + np.flatnonzero(np.diff(values[:, 0]) == 0)
        for x in values.T:
            if len(alike):
                alike = alike[np.nan_to_num(x[alike - 1]) == np.nan_to_num(x[alike])]
        same[begin - 1 + alike] = True
    return same


def recounted(
    samples: Samples, segments: Sequence[Integers], rate: float
) -> tuple[Samples, list[Integers], RowCount]:
    """Return samples with the time of the rows, segments without surplus rows, and the findings.

    Parameters
    ----------
    segments : sequence of ndarray of int
        Chosen rows, in independent parts.
    rate : float
        Stated rate of the rows [Hz].
    """
    count, shift, parts = RowCount(), np.zeros(len(samples.time)), []
    for rows in segments:
        same = repeats_before(samples, rows)
        kept = np.flatnonzero(~same & samples.complete[rows])
        counted = np.diff(kept)
        if np.count_nonzero(same) >= SHARE * len(rows) or len(kept) < 2 * NEAR + 2:
            parts.append(rows)
            continue
        twice = _repeating(same, kept)
        true, shown = _true_steps(samples.read(rows[kept])[:, : samples.n_joints], counted, twice)
        surplus, missing = (counted - true).clip(0), (true - counted).clip(0)
        if surplus[shown & twice].sum() > 0.5 * (counted - 1)[shown & twice].sum():
            short = twice & ~shown & (counted - 1 <= max(1.0, BRIDGED * rate))
            surplus[short] = counted[short] - 1
        if missing.sum() >= SHARE * len(rows):
            missing[:] = 0
        shift[rows[kept[1:]]] += (missing - surplus) / rate
        left_out = np.zeros(len(rows), dtype=bool)
        for at in np.flatnonzero(surplus):
            left_out[kept[at] + 1 : kept[at] + 1 + surplus[at]] = True
        parts.append(rows[~left_out])
        count.surplus += int(surplus.sum())
        count.missing += int(missing.sum())
        if surplus.any():
            first = int(rows[kept[np.flatnonzero(surplus)[0]]]) + 2
            count.first_surplus = count.first_surplus or first
        if missing.any():
            first = int(rows[kept[np.flatnonzero(missing)[0]]]) + 1
            count.first_missing = count.first_missing or first
    if count.surplus or count.missing:
        samples = replace(samples, time=samples.time + np.cumsum(shift))
    return samples, parts, count


def _repeating(same: Mask, kept: Integers) -> Mask:
    """Return a mask of the steps over repeated rows only."""
    passed = np.cumsum(same)
    counted = np.diff(kept)
    return np.asarray((counted > 1) & (np.diff(passed[kept]) == counted - 1))


def _true_steps(q: Array, counted: Integers, twice: Mask) -> tuple[Integers, Mask]:
    """Return the number of periods of steps, and a mask of the steps that show the number.

    `counted` are the periods by the count of rows, `twice` the steps over repeated rows.
    """
    steps = np.asfortranarray(np.diff(q, axis=0))
    need = max(1, min(2, int(np.count_nonzero(steps.any(axis=0)))))
    noise, wide = np.zeros(q.shape[1]), np.zeros(len(steps), dtype=np.intp)
    for joint, (x, step) in enumerate(zip(q.T, steps.T, strict=True)):
        size = np.abs(step)
        usual = float(np.median(size[size > 0])) if size.any() else 0.0
        fast = 1 + np.flatnonzero(size[1:-1] >= usual)
        rough = np.abs(step[fast] - (step[fast - 1] + step[fast + 1]) / 2)
        # 1.48 median deviations are a standard deviation
        noise[joint] = 1.48 * float(np.median(rough)) if len(rough) else np.inf
        near = np.minimum(np.minimum(size[:-4], size[1:-3]), np.minimum(size[3:-1], size[4:]))
        far = (size[2:-2] > 1.5 * near) & (size[2:-2] > CLEAR * noise[joint])
        if far.any():
            # sorting takes long, and a share of the rows shows the same increment
            some = x[:: max(1, len(x) // 50_000)]
            wide[2:-2] += far & (size[2:-2] > INCREMENTS * increment(some))
    true, shown = counted.copy(), np.zeros(len(counted), dtype=bool)
    at = np.flatnonzero((wide >= need) | twice)
    at = at[(at >= NEAR) & (at < len(counted) - NEAR)]
    if not len(at):
        return true, shown
    about = at[:, None] + np.arange(1, NEAR + 1) * np.array([[[-1]], [[1]]])
    ordinary = np.median(steps[about], axis=2).mean(axis=0)
    rounding = np.stack([increments(x, at) for x in q.T], axis=1)
    least = np.maximum(CLEAR * noise, INCREMENTS * rounding)
    clear, visible = np.abs(ordinary) > least, np.abs(ordinary) > WHOLE * least
    ordinary = np.where(visible, ordinary, 1.0)
    # a late row has a short step beside it, and joints that start at once have other speeds
    for beside in (steps[at - 1], steps[at + 1]):
        clear &= np.abs(beside / ordinary - 1.0) < 2 * WHOLE
    # where a row is repeated, and one joint alone moves, this joint suffices
    alone = twice[at] & (visible.sum(axis=1) == 1)
    enough = clear.sum(axis=1) >= np.where(alone, 1, need)
    at, clear, visible = at[enough], clear[enough], visible[enough]
    if not len(at):
        return true, shown
    ratio = steps[at] / ordinary[enough]
    whole = np.rint(np.nanmedian(np.where(clear, ratio, np.nan), axis=1))
    off, by_count = np.abs(ratio - whole[:, None]), np.abs(ratio - counted[at, None])
    against = (clear & (off >= WHOLE)) | (visible & (off > by_count))
    sure = ~against.any(axis=1) & (whole >= 1) & (whole <= LONGEST)
    true[at[sure]], shown[at[sure]] = whole[sure].astype(np.int64), True
    return true, shown


def increments(x: Array, rows: Integers) -> Array:
    """Return the increments between rows and the next: of significant digits, they grow with x."""
    values = np.sort(x)
    values = values[np.diff(values, prepend=-np.inf) > 0.5 * increment(values)]
    # the least of ten steps is far below a jump, unless values are rounded
    steps = np.pad(np.diff(values), 5, constant_values=np.inf)
    least = sliding_window_view(steps, 10).min(axis=1)
    ends = np.searchsorted(values, x[[rows, rows + 1]]).clip(max=len(values) - 1)
    return np.asarray(least[ends].max(axis=0))
