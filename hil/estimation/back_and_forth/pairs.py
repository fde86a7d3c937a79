"""Which samples are of which stroke, which bin of position, and which pairs are of use.

A pair is a stroke forth and the stroke back that follows it, as the import numbered them. Samples
near a reversal, where friction is no function of the velocity, are left out. Bins of position hold
about as many samples each, `SAMPLES` of a stroke at least, so they are narrow where the axis is
slow and its speed changes from one position to the next.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.free_motion.motion import Motion

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]

SLOW = 0.05
"""Share of the recording's speed below which the axis counts as reversing."""
SAMPLES = 4
"""Of a stroke in a bin, about, where strokes are short."""
BINS = 8, 60
"""Of the whole way, at least and at most."""
FEWEST = 4
"""Bins that both strokes of a pair must pass."""
UNLIKE = 1.5
"""Ratio of the speeds forth and back at the same positions from which on a pair is of no use."""


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """A stroke forth and one back over the same bins.

    Attributes
    ----------
    number : int
        In its recording, from 0.
    forth, back : ndarray of int
        Filtered samples.
    bins : ndarray of int
        Of the recording that both strokes pass.
    bins_forth, bins_back : ndarray of int
        The place of each sample's bin among these.
    """

    number: int
    forth: Indices
    back: Indices
    bins: Indices
    bins_forth: Indices
    bins_back: Indices

    def halves(self, x: Array) -> tuple[Array, Array]:
        """Half-sums and half-differences of columns at the filtered samples, by bin."""
        forth = _means(x[self.forth], self.bins_forth, len(self.bins))
        back = _means(x[self.back], self.bins_back, len(self.bins))
        return (forth + back) / 2, (forth - back) / 2

    @property
    def weights(self) -> Array:
        """Reciprocal variances of either half, for samples of variance 1, shape of `bins`."""
        forth, back = (
            np.bincount(bins, minlength=len(self.bins))
            for bins in (self.bins_forth, self.bins_back)
        )
        found: Array = 4.0 / (1.0 / forth + 1.0 / back)
        return found


def pairs_of(
    motion: Motion, stroke: NDArray[np.int16], axis: int, unit: str
) -> tuple[list[Pair], list[str]]:
    """Pairs of a recording, and why others are of no use.

    Parameters
    ----------
    motion : Motion
    stroke : ndarray, shape (n_used,)
        Number of the stroke of each filtered sample, even forth, odd back; -1 between strokes.
    axis : int
        That moves, from 0.
    unit : str
        Of its positions.
    """
    q, qd = (x[:: motion.rates.coarse][: len(motion.tau), axis] for x in (motion.q, motion.qd))
    steady = motion.used & (motion.slowest[:, axis] >= SLOW)
    strokes = [
        np.flatnonzero(steady & (stroke == number) & (qd > 0 if number % 2 == 0 else qd < 0))
        for number in range(int(stroke.max(initial=-1)) + 1)
    ]
    edges = _edges(q, strokes)
    found, useless = [], []
    for number, (forth, back) in enumerate(zip(strokes[::2], strokes[1::2], strict=False)):
        reason = _reason(q, qd, forth, back, edges, unit)
        if reason:
            useless.append(f"pair {number + 1}: {reason}")
        else:
            found.append(_pair(number, q, forth, back, edges))
    return found, useless


def _edges(q: Array, strokes: list[Indices]) -> Array:
    """Bounds of the bins of a recording's positions."""
    lengths = [len(each) for each in strokes if len(each)]
    if not lengths:
        return np.zeros(2)
    every = q[np.concatenate(strokes)]
    n = int(np.clip(np.median(lengths) // SAMPLES, *BINS))
    return np.unique(np.quantile(every, np.linspace(0.0, 1.0, n + 1)))


def _bins(q: Array, edges: Array) -> Indices:
    return np.clip(np.searchsorted(edges, q, side="right") - 1, 0, len(edges) - 2)


def _common(q: Array, forth: Indices, back: Indices, edges: Array) -> Indices:
    """Bins that both strokes pass."""
    return np.intersect1d(_bins(q[forth], edges), _bins(q[back], edges))


def _reason(q: Array, qd: Array, forth: Indices, back: Indices, edges: Array, unit: str) -> str:
    """Why a pair is of no use; empty where it is."""
    if not (len(forth) and len(back)):
        return (
            "a stroke is too short for the low-pass; record longer strokes, or state a higher"
            " cut_off in the map"
        )
    common = _common(q, forth, back, edges)
    if len(common) < FEWEST:
        ways = (f"{q[each].min():.3g} to {q[each].max():.3g} {unit}" for each in (forth, back))
        there, again = ways
        return (
            f"forth it passes {there}, back {again}, which is {len(common)} bins of position in"
            f" common where {FEWEST} are needed; let both strokes go over the same way"
        )
    speeds = [
        float(np.mean(np.abs(qd[each][np.isin(_bins(q[each], edges), common)])))
        for each in (forth, back)
    ]
    if max(speeds) > UNLIKE * min(speeds):
        return (
            f"forth it goes at {speeds[0]:.3g} {unit}/s, back at {speeds[1]:.3g} {unit}/s, a ratio"
            f" above {UNLIKE:g}: friction at such different speeds does not cancel; move both ways"
            " at one speed, or write kind: free"
        )
    return ""


def _pair(number: int, q: Array, forth: Indices, back: Indices, edges: Array) -> Pair:
    common = _common(q, forth, back, edges)
    kept = [each[np.isin(_bins(q[each], edges), common)] for each in (forth, back)]
    places = [np.searchsorted(common, _bins(q[each], edges)) for each in kept]
    return Pair(number, kept[0], kept[1], common, places[0], places[1])


def _means(x: Array, bins: Indices, n: int) -> Array:
    sums = np.zeros((n, x.shape[1]))
    np.add.at(sums, bins, x)
    return np.asarray(sums / np.bincount(bins, minlength=n)[:, np.newaxis])
