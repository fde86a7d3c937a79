"""Held samples: measurements published several times each.

Between two measurements a held value repeats exactly, and its stamps go on. A coarse encoder
repeats itself as well, but then moves by a count or two: values that stand still on either side of
a step of more counts are held. Where positions are, the rows in which they change are samples, and
all others repeat one. Other columns that are held are the subject of `hil.imports.held_columns`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.imports.tables import ROWS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.samples import Samples

EXCERPT = 20_000
"""Rows that are looked at: shares are known to 1 %."""
_STEPS = 20
"""Steps of a column from which on their shares say something: 0.9 of so many is 3 standard
deviations above a half."""
_COUNTS = 3
"""Counts that no coarse encoder moves by between samples that repeat: of a steady speed below one
count a sample it moves by one, of rounding by two."""
_HELD = 0.9
"""Share of the steps that stand alone where values are held; a recorder is late now and then."""


def held_of(samples: Samples, parts: Sequence[Integers]) -> int:
    """Return over how many rows positions are held; 1 where they are not."""
    longest = max(parts, key=len)
    middle = longest[max(0, len(longest) // 2 - EXCERPT // 2) :][:EXCERPT]
    positions = np.asarray(samples.values[middle])[:, : samples.n_joints]
    return max(map(rows_held, positions.T))


def rows_held(x: Array) -> int:
    """Count the rows over which a column holds its values; 1 where nothing is held.

    Parameters
    ----------
    x : array (n,)
    """
    steps = np.abs(np.diff(x))
    steps = steps[np.isfinite(steps)]
    changed = np.flatnonzero(steps)
    if len(changed) < _STEPS:
        return 1
    wide = changed[steps[changed] >= _COUNTS * steps[changed].min()]
    wide = wide[(wide > 0) & (wide < len(steps) - 1)]
    if len(wide) < _STEPS:
        return 1
    alone = (steps[wide - 1] == 0) & (steps[wide + 1] == 0)
    return round(float(np.median(np.diff(changed)))) if alone.mean() >= _HELD else 1


def measured(samples: Samples, rows: Integers, held: int) -> Integers:
    """Return the rows of new measurements, each held over `held` rows.

    Positions change in them, or would by their number if they moved: what stands still for long is
    measured as often as what moves.
    """
    changes = np.concatenate([*_changes(samples, rows)])
    starts = np.flatnonzero(changes)
    lengths = np.diff(np.append(starts, len(rows)))
    since = np.arange(len(rows)) - np.repeat(starts, lengths)
    left = np.repeat(lengths, lengths) - since
    return np.asarray(rows[(since % held == 0) & ((since == 0) | (left >= held))])


def _changes(samples: Samples, rows: Integers) -> Iterator[Mask]:
    """Yield masks of the rows with other positions than the row before, block by block."""
    yield np.ones(1, dtype=bool)
    for begin in range(0, len(rows) - 1, ROWS):
        some = np.nan_to_num(samples.values[rows[begin : begin + ROWS + 1], : samples.n_joints])
        yield (np.diff(some, axis=0) != 0).any(axis=1)
