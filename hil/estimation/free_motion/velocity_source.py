"""Recorded velocity or the derivative of the position, joint by joint.

A recorded velocity is taken if, over the stretches that were looked at,

- it says the same as the derivative of the position: they differ by at most `SAME` of its size;
- it lags by at most `LAG` periods, for one that lags, since a filter made it, shifts friction and
  inertia against the torque. With derivatives v and a of the position, v(t - lag) is v - lag a;
- its noise below the cut-off frequency is less. Noise is what spectra show near half the sampling
  rate, where nothing moves; a derivative raises that of a position by the square of the frequency.

Of each figure the median over the stretches counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.filtering import low_passed, reach
from hil.estimation.free_motion.spectra import floor, spectrum

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

SAME = 0.1
"""Difference of two velocities, over their size, up to which they are the same."""
LAG = 0.5
"""Lag that is accepted, in periods."""


@dataclass(frozen=True, slots=True)
class VelocitySource:
    """Where the velocity of an axis comes from, and why.

    Attributes
    ----------
    recorded : bool
        Whether it is taken as it was recorded.
    reason : str
        Half a sentence.
    """

    recorded: bool
    reason: str


def velocity_sources(stretches: Sequence[Recording], cut_off: float) -> tuple[VelocitySource, ...]:
    """Choose the velocity of each axis.

    Parameters
    ----------
    stretches : sequence of Recording
        Parts of all recordings.
    cut_off : float
        Of the low-pass that velocities pass [Hz].
    """
    n = stretches[0].n_joints
    present = np.all([_recorded(part) for part in stretches], axis=0)
    figures = np.full((len(stretches), 3, n), np.nan)
    for row, part in zip(figures, stretches, strict=True):
        row[:, present] = _figures(part, present, cut_off)
    return tuple(
        _source(figures[:, :, axis], stretches[0].period)
        if present[axis]
        else VelocitySource(recorded=False, reason="none was recorded")
        for axis in range(n)
    )


def _recorded(part: Recording) -> NDArray[np.bool_]:
    if part.qd is None:
        return np.zeros(part.n_joints, dtype=bool)
    return np.asarray(np.isfinite(part.qd).all(axis=0))


def _figures(part: Recording, axes: NDArray[np.bool_], cut_off: float) -> Array:
    """Difference over size, lag [s], noise over the derivative's, of these axes: (3, n_axes).

    NaN where an axis does not move.
    """
    if part.qd is None or not axes.any():
        return np.empty((3, 0))
    q, qd, period = part.q[:, axes], part.qd[:, axes], part.period
    edge = reach(period, cut_off)
    kept = slice(edge, len(q) - edge)
    _, v, a = (x[kept] for x in low_passed(q, period, cut_off, derivatives=2))
    recorded = low_passed(qd, period, cut_off)[0][kept]
    size = np.sqrt(np.sum(v**2, axis=0))
    moves = size > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        different = np.sqrt(np.sum((v - recorded) ** 2, axis=0)) / size
        lag = np.array([_lag(*each) for each in zip(v.T, a.T, recorded.T, strict=True)])
        noise = np.sqrt(_noise(qd, period, cut_off, 0) / _noise(q, period, cut_off, 1))
    return np.where(moves, np.stack([different, lag, noise]), np.nan)


def _lag(v: Array, a: Array, recorded: Array) -> float:
    """How late a recorded velocity is [s], whatever its scale; 0 where that cannot be seen."""
    scale, shift = np.linalg.lstsq(np.stack([v, a], axis=1), recorded, rcond=None)[0]
    return float(-shift / scale) if abs(scale) > SAME else 0.0


def _noise(x: Array, period: float, cut_off: float, derivatives: int) -> Array:
    """Mean square of each column's noise below the cut-off, after so many derivatives."""
    k = 2 * derivatives
    band = (2 * np.pi) ** k * cut_off ** (k + 1) / (k + 1)
    return np.array([floor(*spectrum(column, period), period) for column in x.T]) * band


def _source(figures: Array, period: float) -> VelocitySource:
    """Judge the figures (n_stretches, 3) of an axis."""
    moving = figures[np.isfinite(figures[:, 0])]
    if not len(moving):
        return VelocitySource(recorded=False, reason="the axis does not move")
    different, lag, noise = np.median(moving, axis=0)
    if different > SAME and not abs(lag) > LAG * period:
        reason = f"the recorded one differs from it by {100 * different:.2g} %"
    elif abs(lag) > LAG * period:
        late = "late" if lag > 0 else "early"
        reason = f"the recorded one is {1e3 * abs(lag):.3g} ms {late}"
    elif not noise < 1:
        reason = f"the recorded one has {noise:.2g} times its noise"
    else:
        return VelocitySource(
            recorded=True, reason=f"it has {noise:.2g} times the noise of the derivative"
        )
    return VelocitySource(recorded=False, reason=reason)
