"""Held samples: values published several times.

Between two measurements a held value repeats exactly while its stamps advance. A coarse column also
repeats its value by chance; with n increments in a usual step, about one row in n is a repetition.
A held column repeats its value more often while the joint moves. If all positions are held alike,
the rows with a change are samples, and all other rows are repetitions; a single held column is
detected in `hil.imports.plausibility`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.imports.tables import ROWS
from hil.least_squares.standstill import increment, share_at_top

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.samples import Samples

EXCERPT = 20_000
"""Number of inspected rows, for shares accurate to 1 %."""
OFTENER = 5.0
"""Minimum ratio of repetitions to chance repetitions for held values.

Noise may repeat a value in one row; held values repeat in three more, with a margin of one.
"""
SHARE = 0.2
"""Minimum share of repeating rows for held values.

Below this share, the mean delay of a column is less than a tenth of a sample.
"""
RARE = 0.05
"""Maximum share of uneven rows: of moving rows at a bound, and of rows before a jump. Where one row
in twenty is uneven, rows repeat or a clock is coarse (`hil.imports.instants`)."""
_HELD = 0.9
"""Minimum share of isolated steps for held values; a recorder is sometimes late."""
SLOW = 0.05
"""Share of the greatest speed below which an axis counts as at rest."""
_ABOUT = np.ones(9)
"""Window in rows for the motion of a held position."""


def held_of(samples: Samples, parts: Sequence[Integers]) -> int:
    """Return the number of rows over which positions are held; 1 if none are held."""
    longest = max(parts, key=len)
    middle = longest[max(0, len(longest) // 2 - EXCERPT // 2) :][:EXCERPT]
    positions = np.asarray(samples.values[middle])[:, : samples.n_joints]
    found = max(map(rows_held, positions.T))
    # values of a single held joint do not matter if the other joints are new
    return found if found > 1 and len(measured(samples, middle, found)) < 0.7 * len(middle) else 1


def rows_held(x: Array) -> int:
    """Return the number of rows over which a position is held; 1 without holding.

    Parameters
    ----------
    x : array (n,)
    """
    x = x[np.isfinite(x)]
    steps = np.diff(x) != 0
    alone = steps[1:-1] & ~steps[:-2] & ~steps[2:]
    few = len(x) <= len(_ABOUT) or not alone.any()
    if few or np.count_nonzero(alone) < _HELD * np.count_nonzero(steps[1:-1]):
        return 1
    held = repeats([x], fast_steps([x]))
    return round(float(np.median(np.diff(np.flatnonzero(steps))))) if held else 1


def fast_steps(positions: Sequence[Array]) -> Mask:
    """Return a mask of steps with a speed above the median of all moving steps of a joint.

    Slower steps than a twentieth of the greatest are noise at rest.

    Parameters
    ----------
    positions : sequence of array (n,)
        Positions in successive excerpts.
    """
    ways = np.abs(np.concatenate([np.convolve(np.diff(q), _ABOUT, "same") for q in positions]))
    moves = ways > 0
    if not moves.any():
        return np.asarray(moves)
    return np.asarray(ways >= max(np.median(ways[moves]), SLOW * ways.max()))


def repeats(columns: Sequence[Array], moving: Mask) -> float:
    """Return the share of repetitions in fast motion of a joint; 0 if compatible with chance.

    Parameters
    ----------
    columns : sequence of array (n,)
        Column of a joint in successive excerpts.
    moving : ndarray of bool
        `fast_steps` of the joint.
    """
    if _few(columns, moving, SHARE):
        return 0.0
    steps = np.abs(np.concatenate([np.diff(x) for x in columns]))[moving]
    changes = steps[steps > 0]
    share = 1.0 - len(changes) / max(len(steps), 1)
    if not SHARE < share < 1 or not len(changes):
        return 0.0
    finest = increment(np.concatenate(columns))
    return share if share > OFTENER * min(finest / float(np.median(changes)), 1.0) else 0.0


def _few(columns: Sequence[Array], moving: Mask, share: float) -> bool:
    """Return True if repetitions in all rows are at most a share of the moving rows."""
    repeated = sum(int(np.count_nonzero(x[1:] == x[:-1])) for x in columns)
    return bool(repeated <= share * np.count_nonzero(moving))


def saturated(columns: Sequence[Array], moving: Mask) -> dict[float, float]:
    """Return the bounds at which a column stays, with their shares of fast motion.

    The column has its least or greatest value, unless 0, more often than values next to it.
    Parameters are those of `repeats`.
    """
    if _few(columns, moving, RARE):
        return {}
    x = np.concatenate([x[1:] for x in columns])[moving]
    shares = {float(sign * (sign * x).max()): share_at_top(sign * x) for sign in (-1, 1)}
    return {bound: share for bound, share in shares.items() if share > RARE}


def measured(samples: Samples, rows: Integers, held: int) -> Integers:
    """Return the rows of new measurements, one in every `held` rows.

    Positions change in these rows. While all positions are constant, every row `held` rows after
    the last measurement counts as a measurement.
    """
    changes = np.concatenate([*_changes(samples, rows)])
    starts = np.flatnonzero(changes)
    lengths = np.diff(np.append(starts, len(rows)))
    since = np.arange(len(rows)) - np.repeat(starts, lengths)
    left = np.repeat(lengths, lengths) - since
    return np.asarray(rows[(since % held == 0) & ((since == 0) | (left >= held))])


def _changes(samples: Samples, rows: Integers) -> Iterator[Mask]:
    """Yield masks of the rows with other positions than the previous row, block by block."""
    yield np.ones(1, dtype=bool)
    for begin in range(0, len(rows) - 1, ROWS):
        some = np.nan_to_num(samples.values[rows[begin : begin + ROWS + 1], : samples.n_joints])
        yield (np.diff(some, axis=0) != 0).any(axis=1)
