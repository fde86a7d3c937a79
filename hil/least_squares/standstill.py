"""Detection of moving axes: position ranges compared with the measurement noise.

Noise is the scatter of positions about parabolas over spans too short for a robot to reverse, or
the rounding to encoder increments. An axis moves if its range, with noise averaged over these
spans, is wider than the noise band; a locked axis with a noisy encoder counts as standing.

A brake may close while an axis rests and open while it moves: drives then record exactly the same
torque, often 0, whatever the other axes do. Such samples are left out (`braked`). A torque that is
only nearly constant, or constant while all axes rest, still shows the weight.

A torque limited by a drive, a filter or a recorder has exactly the same greatest or least value in
many samples of motion. Such samples are left out as well (`limited`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Mask


SPAN = 0.1
"""Duration of a parabola [s]: motion up to 3 Hz, guided or planned, deviates from it by 2 %.
"""
FEWEST = 5
"""Minimum number of samples of a span: two more than the parabola's coefficients."""
CARRIED = (0.4 / 10.0) ** 2
"""Largest deflection of a standing axis, relative to the widest range of the axes.

Motion of range R and frequency f accelerates an arm by (2 pi f)^2 R. Coupling carries at most as
much to another axis, which a servo of bandwidth f_s holds within (f / f_s)^2 R: 0.4 Hz are usual of
a motion, and 10 Hz of a servo."""
YIELDED = (0.4 / 4.0) ** 2
"""Largest deflection of a standing axis with a servo of 4 Hz, as of arms under impedance control or
a policy, relative to the widest range of the axes."""
NOISY = 10.0
"""Width of the noise band in standard deviations: one sample of two million lies outside."""
ROUNDING = 1e-9
"""Rounding of converted counts, relative to the position: a count of 32 bits has 2e-10."""


FLICKER = 1.65
"""Median second difference of white noise, over its standard deviation: noise as large as an
increment keeps three values in ten."""
CHANCE = 20
"""Fewest samples of a constant torque: with three equal values in ten, so many in a row are no
chance even in a day at 1 kHz."""
LEVEL = 0.01
"""Minimum share of samples in motion at the greatest torque, for a limit."""
NEXT = 5.0
"""Minimum ratio of samples at the greatest torque to samples at one of the next lower torques. A
smooth maximum in steps has 1 / (sqrt(2) - 1) = 2.4 times as many as the next step."""
SLOW = 0.05
"""Share of the greatest speed below which an axis may rest."""
_WIDTH = 1e-6


class Extent(NamedTuple):
    """Lowest and highest mean of spans, and noise, each (n_joints,)."""

    low: Array
    high: Array
    noise: Array


def extent(q: Array, period: float) -> Extent:
    """Compute the extent of positions (n, n_joints) sampled every `period` [s]."""
    span = max(FEWEST, round(SPAN / period))
    if len(q) < span:
        return Extent(q.min(axis=0), q.max(axis=0), np.zeros(q.shape[1]))
    spans = q[: len(q) // span * span].reshape(-1, span, q.shape[1])
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, span), 3))
    left = spans - basis @ (basis.T @ spans)
    size = max(float(np.abs(left).max()), np.finfo(float).tiny)  # scaled: squares may overflow
    scatter = size * np.sqrt(((left / size) ** 2).sum(axis=(0, 1)) / (len(spans) * (span - 3)))
    means = spans.mean(axis=1)
    noise = [_noise(*each) for each in zip(q.T, scatter.tolist(), strict=True)]
    return Extent(means.min(axis=0), means.max(axis=0), np.array(noise))


def _noise(x: Array, scatter: float) -> float:
    """Return the scatter, or the noise of rounding if this is greater."""
    # a part has an increment no smaller than that of all samples, and sorting takes long
    if 0.0 < increment(x[::16]) < np.sqrt(12.0) * scatter:
        return scatter
    return float(np.maximum(scatter, increment(x) / np.sqrt(12.0)))


def moving(extents: Sequence[Extent]) -> Mask:
    """Find the moving axes from the extents of the recordings, shape (n_joints,)."""
    reach, band, _ = _reaches(extents)
    return np.asarray(reach > band)


def moving_in(extents: Sequence[Extent]) -> Mask:
    """Find the recordings with motion of an axis, shape (n_recordings, n_joints).

    An axis may rest in every recording, at other positions.
    """
    _, band, own = _reaches(extents)
    return np.asarray(own > band)


def _reaches(extents: Sequence[Extent]) -> tuple[Array, Array, Array]:
    """Return ranges over all recordings, noise bands, and ranges by recording."""
    low, high, noise = (np.array(each) for each in zip(*extents, strict=True))
    reach = high.max(axis=0) - low.min(axis=0)
    band = np.maximum(NOISY * noise.max(axis=0), CARRIED * reach.max())
    band = np.maximum(band, ROUNDING * np.abs([low, high]).max(axis=(0, 1)))
    return reach, band, high - low


def increment(x: Array) -> float:
    """Return the least difference of distinct values, apart from rounding of converted counts."""
    steps = np.diff(np.sort(x))  # a tenth of the time of np.unique
    # positions in rad or m: increments are no smaller than those of a range of 1
    real = steps[steps > ROUNDING * max(1.0, float(np.abs(x).max()))]
    return float(real.min(initial=np.inf)) if len(real) else 0.0


def braked(q: Array, tau: Array, period: float) -> Mask:
    """Return a mask of samples at rest, shape (n, n_joints), whose torque says nothing.

    The torque of an axis is constant, but for rounding, over at least `CHANCE` samples and the
    time `SPAN`, in most of which the axis rests, and the same as while another one moves. Elsewhere
    it changes by more than its increment, so the resolution does not explain this.
    """
    found = np.zeros(q.shape, dtype=bool)
    low, high, noise = extent(q, period)
    band = np.maximum(NOISY * noise, CARRIED * np.max(high - low))
    shortest = max(CHANCE, round(SPAN / period))
    for axis, x in enumerate(tau.T):
        same = ROUNDING * np.abs(x).max()
        cuts = np.flatnonzero(np.abs(np.diff(x)) > same) + 1
        edges = np.concatenate([[0], cuts, [len(x)]])
        runs = np.flatnonzero(np.diff(edges) >= shortest).tolist()
        free = np.repeat(np.diff(edges) < shortest, np.diff(edges))[1:-1]
        bends = np.abs(np.diff(x, 2))[free]
        if not runs or not len(bends) or np.median(bends) < FLICKER * increment(x):
            continue
        rests, levels = [], []
        for k in runs:
            run = slice(*edges[k : k + 2].tolist())
            moves, own = np.ptp(q[run], axis=0) > band, q[run, axis]
            moves[axis] = False  # a brake may close before the axis rests
            if np.median(np.abs(own - np.median(own))) <= band[axis]:
                rests.append(run)
                levels += [x[run.start]] * bool(moves.any())
        for run in rests:
            found[run, axis] = (np.abs(x[run.start] - np.array(levels)) <= same).any()
    return found


def limited(q: Array, tau: Array, period: float) -> Mask:
    """Return a mask of samples in motion with a torque at a limit, shape (n, n_joints)."""
    found, over = np.zeros(q.shape, dtype=bool), np.ones(max(1, round(SPAN / period)))
    for axis, x in enumerate(tau.T):
        way = np.abs(np.convolve(np.diff(q[:, axis], prepend=q[0, axis]), over, "same"))
        moves = way > SLOW * way.max()
        for torque in (x, -x) if moves.any() else ():
            if share_at_top(torque[moves]):
                found[:, axis] |= moves & (torque >= _bound(torque[moves]))
    return found


def share_at_top(torque: Array) -> float:
    """Return the share of samples at the greatest torque, shape (n,), if it is a limit, or 0.

    A greatest torque of 0 is no limit: the joint has no motor, or friction in one direction.
    """
    least = _bound(torque)
    at_top = int(np.count_nonzero(torque >= least))
    if not least or at_top <= LEVEL * len(torque):
        return 0.0
    below = np.unique(torque[torque < least], return_counts=True)[1][-20:]
    return at_top / len(torque) if at_top > NEXT * below.max(initial=0) else 0.0


def _bound(torque: Array) -> float:
    top = float(torque.max())
    return top - _WIDTH * abs(top)
