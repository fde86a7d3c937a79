"""Choose cut-off frequency and velocity source from the recordings.

The spectrum of a position falls to the noise floor of the measurement, which is about constant over
frequency and alone near half the sampling rate. Below the frequency where the spectrum is `ABOVE`
times that floor, the motion can be differentiated twice; above, accelerations become noise. That
frequency, the median over the axes in stretches with motion, is the cut-off frequency unless the
map states one. A period of the cut-off has at least `FINE` samples, and the cut-off is at most
`HIGHEST`, where no arm is rigid any more.

Torque and columns are filtered with a third of that cut-off. Positions must keep sharp bends, such
as the start of a trapezoid, or columns are wrong; the equation holds in any band, with less noise
in a narrow one. Coarse encoders have a low cut-off, and a third of it would remove most of the
motion: up to `RIGID`, torque is filtered with `CLOSEST` times less only.

The recorded velocity replaces the derivative of the position, joint by joint, if, over the surveyed
stretches,

- both velocities agree: they differ by at most `SAME` of their size;
- the recorded one lags by at most `LAG` periods, which `filtered_motion` compensates: a lag shifts
  friction and inertia against the torque, and a filter of more lag changes the velocity, too;
- the recorded one has less noise below the cut-off frequency. Noise is the spectrum near half the
  sampling rate, where nothing moves; differentiation multiplies the power density of a position by
  the square of the frequency.

For each figure the median over the stretches counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

from hil.estimation.free_motion.motion import (
    BANDS,
    FINE,
    LAG,
    SAME,
    Processing,
    low_passed,
    reach,
    velocity_lags,
)
from hil.least_squares.standstill import extent, moving, moving_in

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.free_motion.survey import Survey
    from hil.runs.recording import Recording

WINDOW = 4.0
"""Longest window of the spectra [s]."""
FLOOR = 0.3
"""Lowest frequency of pure noise, as a share of the sampling rate."""
ABOVE = 100.0
"""Ratio of motion power to noise power at the cut-off."""
CLOSEST = 1.5
"""Lowest ratio of both cut-offs: the low-pass of positions then leaves 96 % in the equation."""
RIGID = 5.0
"""Frequency up to which arms are rigid [Hz]: half of the lowest resonance of industrial arms."""
HIGHEST, LOWEST = 100.0, 1.0
"""Bounds of the chosen cut-off frequency [Hz]."""


@dataclass(frozen=True, slots=True)
class Reasons:
    """Reasons for the settings, in half sentences.

    Attributes
    ----------
    velocities : tuple of str
        Reason for each joint.
    """

    cut_off: str
    velocities: tuple[str, ...]


def processing_of(found: Survey) -> tuple[Processing, Reasons]:
    """Choose the settings for the recordings, with reasons."""
    period = found.stretches[0].period
    # the longest stretches, with the most information
    long = sorted(found.stretches, key=lambda part: -part.n_samples)[:10]
    moves = moving_in([extent(part.q, part.period) for part in long])
    moves[:, list(found.still)] = False
    each = [
        bandwidth(*spectrum(long[k].q[:, axis], period), period)
        for k, axis in np.argwhere(moves).tolist()
    ]
    cut_off, reason = cut_off_of(each, period, found.cut_off)
    sources = velocity_sources(long, cut_off)
    recorded = np.array([source.recorded for source in sources])
    reasons = Reasons(reason, tuple(source.reason for source in sources))
    none = np.zeros(len(found.speed))
    processing = Processing(
        cut_off, band_of(cut_off), found.speed, recorded, none, none, rest=found.rest
    )
    return processing, reasons


def band_of(cut_off: float) -> float:
    """Return the cut-off frequency of torque and columns [Hz] for that of the positions."""
    return max(cut_off / BANDS, min(cut_off / CLOSEST, RIGID))


def cut_off_of(
    bandwidths: Sequence[float], period: float, stated: float | None
) -> tuple[float, str]:
    """Choose the cut-off frequency of the positions [Hz], with the reason.

    Parameters
    ----------
    bandwidths : sequence of float
        Bandwidths of the positions, by `bandwidth` [Hz].
    period : float
        Sampling period [s].
    stated : float or None
        Value in the map [Hz].
    """
    cut_off, reason = (stated, "stated in the map") if stated else _chosen(bandwidths, period)
    # stated or chosen, the cut-off needs enough samples per period
    most = 0.25 / period
    if cut_off > most:
        return most, f"{reason}, but at most a quarter of the sampling rate"
    return cut_off, reason


def _chosen(bandwidths: Sequence[float], period: float) -> tuple[float, str]:
    most = min(1.0 / (FINE * period), HIGHEST)
    wanted = float(np.median(bandwidths)) if bandwidths else most
    if wanted > most:
        return most, "the motion exceeds the noise at all sampled frequencies"
    return max(wanted, LOWEST), (
        f"up to this frequency the positions' spectrum is {ABOVE:g} times the noise or more"
    )


def bandwidth(f: Array, power: Array, period: float) -> float:
    """Return the highest frequency at which a spectrum exceeds its noise floor [Hz]."""
    low = np.flatnonzero(power[2:] < ABOVE * floor(f, power, period))
    return float(f[2 + low[0]]) if len(low) else float(f[-1])


def spectrum(x: Array, period: float) -> tuple[Array, Array]:
    """Return frequencies [Hz] and power density of samples (n,) with a `period` [s].

    Welch's method (IEEE Trans. Audio Electroacoust. 15 (1967) 70-73) with Hann windows overlapping
    by half, after removal of a straight line and of the means.
    """
    n = max(min(len(x) // 4, round(WINDOW / period)), 8)
    t = np.arange(len(x)) - (len(x) - 1) / 2
    level = x - x.mean() - t * (t @ x) / (t @ t)
    parts = np.lib.stride_tricks.sliding_window_view(level, n)[:: n - n // 2]
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n)
    spectra = fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window)
    power = 2.0 * period * np.mean(np.abs(spectra) ** 2, axis=0) / (window @ window)
    # zero and Nyquist frequency have no negative counterpart
    power[0] /= 2.0
    power[-1] /= 1.0 + (n % 2 == 0)
    return fft.rfftfreq(n, period), power


def floor(f: Array, power: Array, period: float) -> float:
    """Return the power density of the noise: the median at frequencies without motion."""
    return float(np.median(power[f > FLOOR / period]))


@dataclass(frozen=True, slots=True)
class VelocitySource:
    """Velocity source of an axis, with the reason.

    Attributes
    ----------
    recorded : bool
        True for the recorded velocity.
    reason : str
        Half a sentence.
    """

    recorded: bool
    reason: str


def velocity_sources(stretches: Sequence[Recording], cut_off: float) -> tuple[VelocitySource, ...]:
    """Choose the velocity source of every axis.

    Parameters
    ----------
    stretches : sequence of Recording
        Parts of all recordings.
    cut_off : float
        Cut-off frequency of the low-pass of velocities [Hz].
    """
    n = stretches[0].n_joints
    present = np.ones(n, dtype=bool)
    for part in stretches:
        present &= False if part.qd is None else np.isfinite(part.qd).all(axis=0)
    figures = np.full((len(stretches), 3, n), np.nan)
    for row, part in zip(figures, stretches, strict=True):
        row[:, present] = _figures(part, present, cut_off)
    return tuple(
        _source(figures[:, :, axis], stretches[0].period)
        if present[axis]
        else VelocitySource(recorded=False, reason="none was recorded")
        for axis in range(n)
    )


def _figures(part: Recording, axes: Mask, cut_off: float) -> Array:
    """Return relative difference, lag [s] and relative noise of velocities, (3, n_axes).

    NaN for an axis at rest.
    """
    if part.qd is None or not axes.any():
        return np.empty((3, 0))
    q, qd, period = part.q[:, axes], part.qd[:, axes], part.period
    edge = reach(period, cut_off)
    kept = slice(edge, len(q) - edge)
    _, v, a = (x[kept] for x in low_passed(q, period, cut_off, derivatives=2))
    recorded = low_passed(qd, period, cut_off)[0][kept]
    size = np.sqrt(np.sum(v**2, axis=0))
    moves = moving([extent(q, period)])
    with np.errstate(divide="ignore", invalid="ignore"):
        different = np.sqrt(np.sum((v - recorded) ** 2, axis=0)) / size
        lag = velocity_lags(v, a, recorded)
        noise = np.sqrt(_noise(qd, period, cut_off, 0) / _noise(q, period, cut_off, 1))
    return np.where(moves, np.stack([different, lag, noise]), np.nan)


def _noise(x: Array, period: float, cut_off: float, derivatives: int) -> Array:
    """Return the mean squared noise of columns below the cut-off, after derivatives."""
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
        reason = f"the recorded velocity differs from the derivative by {100 * different:.2g} %"
    elif abs(lag) > LAG * period:
        late = "late" if lag > 0 else "early"
        reason = f"the recorded velocity is {1e3 * abs(lag):.3g} ms {late}"
    elif not noise < 1:
        reason = f"the recorded velocity has {noise:.2g} times the noise of the derivative"
    else:
        return VelocitySource(
            recorded=True, reason=f"{noise:.2g} times the noise of the derivative"
        )
    return VelocitySource(recorded=False, reason=reason)
