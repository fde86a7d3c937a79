"""Motion and torques in excerpts of a recording, and contradictions to the map.

Plausibility is judged on excerpts of some seconds; all excerpts together are the evidence.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.settings import floor, spectrum
from hil.imports.held import SLOW
from hil.imports.instants import resampled
from hil.imports.segments import Piece
from hil.least_squares.standstill import SPAN, extent, moving

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.map_file import Check
    from hil.imports.samples import Samples
    from hil.least_squares.standstill import Extent


GRAVITY: tuple[Check, ...] = ("shape", "spikes", "range", "velocity", "still", "friction")
"""Checks, the gravest first: torques, single values, limits, velocities, which are optional."""


@dataclass(frozen=True)
class Suspicion:
    """Contradiction between a recording and its map.

    Attributes
    ----------
    check : Check
        Check that found the contradiction.
    location : tuple
        Place in the map.
    message : str
        Value, bound and remedy in a sentence that follows the place.
    certain : bool
        True if the import is refused; other suspicions are stated.
    first : bool
        True for wrong times of rows, from which the misfit of any model follows.
    last : bool
        True for a joint at rest: no mistake.
    """

    check: Check
    location: tuple[str | int, ...]
    message: str
    certain: bool = True
    first: bool = False
    last: bool = False

    @property
    def gravity(self) -> tuple[bool, bool, int]:
        """Key that sorts suspicions, the gravest first."""
        return not self.first, self.last, GRAVITY.index(self.check)


HALF_WIDTH = 0.02
"""Half width of the window of a local fit [s]."""
_MARGIN = 3
"""Samples read beyond a grid: two for slopes of cubics, and one for rounding."""
_LENGTH = 10.0
"""Usual duration of an excerpt [s]."""
_SAME = 1e-3
"""Distance from a grid counted as zero, in periods: a tenth of `instants.EVEN`."""


@dataclass(frozen=True, eq=False)
class Excerpt:
    """Even samples of a part of a recording: arrays (n, n_joints), SI, joint side.

    Motion is fitted at `points` samples; `begin` is the time of the first sample in the recording
    [s].
    """

    period: float
    q: Array
    tau: Array
    qd: Array
    points: int
    begin: float = 0.0

    @cached_property
    def extent(self) -> Extent:
        """Range and noise of the positions."""
        return extent(self.q, self.period)

    @cached_property
    def white(self) -> Array:
        """Variance of the positions' white noise, by the floor of the spectrum, (n_joints,)."""
        floors = [floor(*spectrum(q, self.period), self.period) for q in self.q.T]
        # white noise of a variance has twice its product with the period as density
        return np.array(floors) / (2.0 * self.period)

    @cached_property
    def fitted(self) -> tuple[Integers, tuple[Array, ...], Array]:
        """Parabolas through the positions around some samples, and means of torques and velocities.

        Samples (n,); q, qd, qdd, torque and recorded velocity, each (n, n_joints); standard
        deviations of qd and qdd by the noise of positions, (2, n_joints).
        """
        half, fit = half_width(self.period), parabola(self.period)
        at = np.linspace(half, len(self.q) - 1 - half, self.points).round().astype(int)
        about = at[:, None] + np.arange(-half, half + 1)
        motion = (np.einsum("w,pwj->pj", row, self.q[about]) for row in fit)
        means = (values[about].mean(axis=1) for values in (self.tau, self.qd))
        noise = np.linalg.norm(fit, axis=1)[1:, None] * self.extent.noise
        return at, (*motion, *means), noise


def even_samples(samples: Samples, piece: Piece) -> tuple[Array, Array, Array]:
    """Return positions, torques and velocities of a piece on an even grid, (n, n_joints) each."""
    instants, grid, rows = piece.stretch.instants, piece.grid, piece.stretch.rows
    begin = max(0, int(np.searchsorted(instants, grid[0])) - _MARGIN)
    end = int(np.searchsorted(instants, grid[-1])) + _MARGIN
    instants, rows = instants[begin:end], rows[begin:end]
    values = _resample(instants, samples.read(rows), grid, piece.stretch.period)
    n = samples.n_joints
    return values[:, :n], values[:, n : 2 * n], values[:, 2 * n :]


def _resample(instants: Array, values: Array, grid: Array, period: float) -> Array:
    """Resample values on a grid; recorded values on the grid are returned unchanged."""
    nearest = np.searchsorted(instants, grid - period / 2).clip(max=len(instants) - 1)
    if np.all(np.abs(instants[nearest] - grid) < _SAME * period):
        first, last = int(nearest[0]), int(nearest[-1]) + 1
        # consecutive rows are a slice, without a copy
        return np.asarray(values[first:last] if last - first == len(grid) else values[nearest])
    return resampled(instants, values, grid)


def excerpts_of(
    samples: Samples, pieces: Sequence[Piece], longest: float = _LENGTH
) -> list[Excerpt]:
    """Return excerpts of at most `longest` seconds from the middle of evenly chosen pieces.

    The part with the most motion of a joint is added if the joint moves less than half as far in
    the excerpts, as in motions joint by joint: half the motion has a quarter of the power.
    """
    # 24 excerpts at most
    chosen = sorted({round(k) for k in np.linspace(0, len(pieces) - 1, min(24, len(pieces)))})
    parts = [_middle(pieces[k], longest) for k in chosen]
    others = [part for piece in pieces for part in _parts(piece, longest)]
    ways = np.array([_way(samples, part) for part in others])
    shown = np.max([_way(samples, part) for part in parts], axis=0)
    rest = shown < ways.max(axis=0) / 2
    parts += [others[k] for k in sorted(set(np.argmax(ways[:, rest], axis=0).tolist()))]
    values = [even_samples(samples, part) for part in parts]
    whole = sum(part.duration for part in parts)
    found = []
    for part, (q, tau, qd) in zip(parts, values, strict=True):
        # motion is fitted at 3000 points over all excerpts
        points = max(20, round(3000 * part.duration / whole))
        begin = float(part.grid[0] - pieces[0].grid[0])
        found.append(Excerpt(part.stretch.period, q, tau, qd, points, begin))
    return sorted(found, key=lambda each: each.begin)


def _way(samples: Samples, part: Piece) -> Array:
    """Return ranges of positions in rows `SPAN` apart, shape (n_joints,)."""
    every = max(1, round(SPAN / part.stretch.period))
    at = np.searchsorted(part.stretch.instants, part.grid[::every])
    rows = part.stretch.rows[at.clip(max=len(part.stretch.rows) - 1)]
    return np.asarray(np.ptp(samples.read(rows)[:, : samples.n_joints], axis=0))


def _middle(piece: Piece, longest: float) -> Piece:
    n = min(piece.n, round(longest / piece.stretch.period) + 1)
    return Piece(piece.stretch, piece.first + (piece.n - n) // 2, n)


def _parts(piece: Piece, longest: float) -> list[Piece]:
    """Cut a piece into excerpts."""
    count = max(1, math.ceil(piece.duration / longest - 1e-6))
    edges = np.linspace(0, piece.n, count + 1).round().astype(int).tolist()
    return [Piece(piece.stretch, piece.first + a, b - a) for a, b in pairwise(edges)]


@dataclass(frozen=True, eq=False)
class Evidence:
    """Motion and torques of all excerpts: arrays (n, n_joints), SI, joint side.

    Values of shape (n_joints,) are the standard deviations of `qd` and `qdd` by the noise of
    positions, the noise of a recorded velocity sample, and True for joints that move by more than
    the noise of their position.
    """

    q: Array
    qd: Array
    qdd: Array
    tau: Array
    recorded_qd: Array
    noise_qd: Array
    noise_qdd: Array
    noise_recorded: Array
    moves: Mask
    duration: float

    @cached_property
    def noise_share(self) -> Array:
        """Ratio of noise to acceleration in motion, root mean squares, shape (n_joints,)."""
        speed = np.abs(self.qd)
        power = np.mean(self.qdd**2, axis=0, where=speed >= SLOW * speed.max(axis=0))
        return np.asarray(self.noise_qdd / np.sqrt(power).clip(1e-300))

    @classmethod
    def join(cls, excerpts: Sequence[Excerpt]) -> Evidence:
        """Join the samples of excerpts."""
        _, samples, noises = zip(*(each.fitted for each in excerpts), strict=True)
        noise_qd, noise_qdd = np.max(noises, axis=0)
        moves = moving([excerpt.extent for excerpt in excerpts])
        recorded = np.max([extent(each.qd, each.period).noise for each in excerpts], axis=0)
        duration = sum(each.period * len(each.q) for each in excerpts)
        joined = map(np.concatenate, zip(*samples, strict=True))
        q, qd, qdd, tau, recorded_qd = joined
        return cls(q, qd, qdd, tau, recorded_qd, noise_qd, noise_qdd, recorded, moves, duration)


def noise_shares(excerpts: Sequence[Excerpt]) -> Array:
    """Return the shares of torques that noise of positions may leave, shape (n_joints,).

    That of white noise in the power of the joint's own accelerations is left by least squares.
    Above one half (`plausibility.coarse`) on any moving joint all are infinite: a torque depends on
    the accelerations of all joints.
    """
    noise, whole = 0.0, 0.0
    for each in excerpts:
        _, (_, _, qdd, *_), _ = each.fitted
        noise = noise + len(qdd) * np.sum(parabola(each.period)[2] ** 2) * each.white
        whole = whole + np.sum(qdd**2, axis=0)
    share = np.asarray(noise / np.maximum(whole, np.finfo(float).tiny))
    most = share[moving([each.extent for each in excerpts])].max(initial=0.0)
    return share if most <= 1 / 2 else np.full_like(share, np.inf)


def beyond_noise(left: Array, here: Array, noise: Array) -> Array:
    """Subtract noise from mean squares, for comparison with the mean squares `here`.

    A smaller value explains nothing of the noise; a greater value counts against it as a whole.
    """
    return np.where(here < left, np.maximum(left - noise, here), left)


def parabola(period: float) -> Array:
    """Return weights of samples in position, velocity, acceleration of a local fit, (3, n)."""
    t = np.arange(-(half := half_width(period)), half + 1) * period
    return np.linalg.pinv(np.stack([np.ones_like(t), t, t**2 / 2], axis=1))


def half_width(period: float) -> int:
    """Return the number of samples on either side of a local fit."""
    return max(2, round(HALF_WIDTH / period))
