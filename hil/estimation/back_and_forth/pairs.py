"""Assign samples to strokes and position bins, and select the usable pairs of strokes.

A pair is a stroke forth and the following stroke back, as numbered by the import. Samples near a
reversal, where friction is no function of the velocity, are left out. Bins of position hold about
equally many samples, and per stroke at least those of one period of the low-pass, so bins are
narrow where the axis is slow and its speed changes quickly with position. Each bin passed by both
strokes of a pair gives two rows: half the sum and half the difference of the means.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.free_motion.motion import COARSE
from hil.friction.equation import SLOW

if TYPE_CHECKING:
    from hil.arrays import Array, Indices, Mask, Numbers
    from hil.estimation.free_motion.motion import Motion

FEWEST = 4
"""Fewest bins passed by both strokes of a pair: two for each unknown of the pair, a level and a
slope of friction."""
BINS = 2 * FEWEST, 60
"""Minimum and maximum number of bins over the whole distance. The maximum gives bins of 3 degrees
for half a turn; within a bin, link columns (of degree two in sines and cosines) change by a tenth.
"""
UNLIKE = 1.5
"""Largest ratio of the speeds forth and back at equal positions. The torque error was 0.34 % at a
ratio of 1.2, and 0.08 % at 1 (benchmarks/back_and_forth.py).
"""


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Usable pairs of a recording and the rows of the regression: bins of a pair, pair after pair.

    Attributes
    ----------
    forth, back : ndarray of int
        Filtered samples of the strokes.
    rows : tuple of ndarray of int
        Row of each sample, forth and back.
    pair, bin : ndarray of int, shape (n_rows,)
        Numbers in the recording, from 0.
    turning : ndarray, shape (n_pairs,)
        Turning points of the pairs, in filtered samples.
    useless : tuple of str
        Rejected pairs with reasons.
    """

    forth: Indices
    back: Indices
    rows: tuple[Indices, Indices]
    pair: Indices
    bin: Indices
    turning: Array
    useless: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.turning)

    @property
    def used(self) -> Indices:
        """Filtered samples of the strokes."""
        return np.concatenate([self.forth, self.back])

    @property
    def weights(self) -> Array:
        """Inverse variance of each row for unit sample variance, shape (n_rows,)."""
        forth, back = map(np.bincount, self.rows)
        return 4.0 / (1.0 / forth + 1.0 / back)

    def halves(self, x: Array) -> Array:
        """Return half-sums and half-differences, shape (2, n_rows, k), of columns (n, k)."""
        sums = np.zeros((2, len(self.pair), x.shape[1]))
        for k, samples in enumerate((self.forth, self.back)):
            np.add.at(sums[k], self.rows[k], x[samples])
        forth, back = (
            x / np.bincount(rows)[:, np.newaxis] for x, rows in zip(sums, self.rows, strict=True)
        )
        return np.stack([forth + back, forth - back]) / 2


def pairs_of(motion: Motion, stroke: Numbers, axis: int, unit: str) -> Pairs:
    """Return the usable pairs of a recording.

    Parameters
    ----------
    motion : Motion
    stroke : ndarray, shape (n_used,)
        Number of the stroke of each filtered sample, even forth, odd back; -1 between strokes.
    axis : int
        Moving axis, from 0.
    unit : str
        Unit of the positions.

    Raises
    ------
    NotEnoughData
        No pair is usable.
    """
    q, qd = (x[:: motion.rates.coarse][: len(motion.tau), axis] for x in (motion.q, motion.qd))
    number, returns = np.divmod(stroke, 2)
    steady = motion.used & (motion.slowest[:, axis] >= SLOW) & (stroke >= 0)
    steady &= np.sign(qd) == np.where(returns, -1, 1)
    # bins of about as many samples each, as narrow as the usual stroke fills
    bins, lengths = np.zeros(len(q), dtype=np.intp), np.bincount(stroke[steady])
    if steady.any():
        n = int(np.clip(np.median(lengths[lengths > 0]) // COARSE, *BINS))
        edges = np.unique(np.quantile(q[steady], np.linspace(0.0, 1.0, n + 1)))
        bins = np.clip(np.searchsorted(edges, q, side="right") - 1, 0, len(edges) - 2)
    # one row for each bin passed by both strokes of a pair
    key = number.astype(np.intp) * BINS[1] + bins
    useless, used = [], steady.copy()
    for pair in range((int(stroke.max(initial=-1)) + 1) // 2):
        own = steady & (number == pair)
        reason = _reason(q, qd, own & (returns == 0), own & (returns == 1), bins, unit)
        if reason:
            useless.append(f"pair {pair + 1}: {reason}")
            used &= ~own
    forth, back = (np.flatnonzero(used & (returns == k)) for k in (0, 1))
    rows = np.intersect1d(key[forth], key[back])
    forth, back = (each[np.isin(key[each], rows)] for each in (forth, back))
    if not useless and not len(rows):
        raise NotEnoughData(
            "no forward stroke with a backward stroke after it; record at least one pair, or "
            "write kind: free"
        )
    if not len(rows):
        more = len(useless) - 1
        also = f" (and {more} more pair{'s' if more > 1 else ''})" if more else ""
        raise NotEnoughData(f"{useless[0]}{also}")
    ends, begins = forth[::-1], back
    last, first = (np.unique(number[each], return_index=True)[1] for each in (ends, begins))
    return Pairs(
        forth=forth,
        back=back,
        rows=(np.searchsorted(rows, key[forth]), np.searchsorted(rows, key[back])),
        pair=rows // BINS[1],
        bin=rows % BINS[1],
        turning=(ends[last] + begins[first]) / 2,
        useless=tuple(useless),
    )


def _reason(q: Array, qd: Array, forth: Mask, back: Mask, bins: Indices, unit: str) -> str:
    """Return why a pair is rejected, or an empty string."""
    if not (forth.any() and back.any()):
        return (
            "a stroke is too short for the low-pass; record longer strokes, or state a higher"
            " cut_off in the map"
        )
    common = np.intersect1d(bins[forth], bins[back])
    if len(common) < FEWEST:
        there, again = (f"{x.min():.3g} to {x.max():.3g} {unit}" for x in (q[forth], q[back]))
        return (
            f"forward {there}, backward {again}: {len(common)} bins of position in common, at "
            f"least {FEWEST} needed; move both strokes over the same range"
        )
    both = np.isin(bins, common)
    speeds = [float(np.mean(np.abs(qd[each & both]))) for each in (forth, back)]
    if max(speeds) > UNLIKE * min(speeds):
        return (
            f"forward at {speeds[0]:.3g} {unit}/s, backward at {speeds[1]:.3g} {unit}/s, a ratio "
            f"above {UNLIKE:g}: friction at such different speeds does not cancel; move in both "
            "directions at the same speed, or write kind: free"
        )
    return ""
