"""Parts of a recording on which its plausibility is judged: some seconds here and there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.resampling import resampled
from hil.imports.segments import Piece
from hil.least_squares.standstill import extent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.imports.samples import Samples
    from hil.least_squares.standstill import Extent

    Array = NDArray[np.float64]

EXCERPTS = 24
"""At most."""
LENGTH = 10.0
"""Of each at most [s]."""
POINTS = 3000
"""At which motion is fitted, of all excerpts together."""
HALF_WIDTH = 0.02
"""Of the samples that a fit takes, on either side [s]."""
_MARGIN = 3
_SAME = 1e-3


@dataclass(frozen=True, eq=False)
class Local:
    """Motion and torques at some instants, fitted over the samples about each: (n, n_joints).

    `noise_qd` and `noise_qdd`, shape (n_joints,), are the standard deviations that noise of
    positions gives `qd` and `qdd`.
    """

    q: Array
    qd: Array
    qdd: Array
    tau: Array
    recorded_qd: Array
    noise_qd: Array
    noise_qdd: Array


@dataclass(frozen=True, eq=False)
class Excerpt:
    """Even samples of a part of a recording: arrays (n, n_joints), SI, joint side."""

    period: float
    q: Array
    tau: Array
    qd: Array
    points: int

    def local(self) -> Local:
        """Parabolas through the positions about some instants, means of all else."""
        return self._local

    @cached_property
    def _local(self) -> Local:
        half = max(2, round(HALF_WIDTH / self.period))
        at = np.linspace(half, len(self.q) - 1 - half, self.points).round().astype(int)
        about = at[:, None] + np.arange(-half, half + 1)
        t = np.arange(-half, half + 1) * self.period
        fit = np.linalg.pinv(np.stack([np.ones_like(t), t, t**2 / 2], axis=1))
        q, qd, qdd = (np.einsum("w,pwj->pj", row, self.q[about]) for row in fit)
        tau, recorded_qd = self.tau[about].mean(axis=1), self.qd[about].mean(axis=1)
        of_noise = np.linalg.norm(fit, axis=1)[:, None] * self.extent.noise
        return Local(q, qd, qdd, tau, recorded_qd, of_noise[1], of_noise[2])

    @cached_property
    def extent(self) -> Extent:
        """Range and noise of the positions."""
        return extent(self.q, self.period)


def even_samples(samples: Samples, piece: Piece) -> tuple[Array, Array, Array]:
    """Positions, torques and velocities of a piece on its even grid, each (n, n_joints)."""
    instants, grid, rows = piece.stretch.instants, piece.grid, piece.stretch.rows
    begin = max(0, int(np.searchsorted(instants, grid[0])) - _MARGIN)
    end = int(np.searchsorted(instants, grid[-1])) + _MARGIN
    instants, rows = instants[begin:end], rows[begin:end]
    values = _on_grid(instants, samples.read(rows), grid, piece.stretch.period)
    n = samples.n_joints
    return values[:, :n], values[:, n : 2 * n], values[:, 2 * n :]


def _on_grid(instants: Array, values: Array, grid: Array, period: float) -> Array:
    """Values on a grid; as they are where all of it was sampled."""
    nearest = np.searchsorted(instants, grid - period / 2).clip(max=len(instants) - 1)
    if np.all(np.abs(instants[nearest] - grid) < _SAME * period):
        return np.asarray(values[nearest])
    return resampled(instants, values, grid)


def excerpts_of(samples: Samples, pieces: Sequence[Piece]) -> list[Excerpt]:
    """Excerpts from the middle of some of the pieces, evenly chosen."""
    chosen = sorted({round(k) for k in np.linspace(0, len(pieces) - 1, min(EXCERPTS, len(pieces)))})
    parts = [_middle(pieces[k]) for k in chosen]
    whole = sum(part.duration for part in parts)
    found = []
    for part in parts:
        q, tau, qd = even_samples(samples, part)
        points = max(20, round(POINTS * part.duration / whole))
        found.append(Excerpt(part.stretch.period, q, tau, qd, points))
    return found


def _middle(piece: Piece) -> Piece:
    n = min(piece.n, round(LENGTH / piece.stretch.period) + 1)
    return Piece(piece.stretch, piece.first + (piece.n - n) // 2, n)
