"""Settings that the recordings deserve: cut-off frequency and source of the velocities.

The spectrum of a position falls until it drowns in the noise of its measurement, which is about the
same at all frequencies and alone near half the sampling rate. Up to where it stands `ABOVE` times
above that floor there is motion that is worth differentiating twice; beyond, accelerations become
noise. That is the cut-off frequency, the median over the axes, unless the map states one. It is at
most `SAMPLED` times the sampling rate and at most `HIGHEST`, where no arm is rigid any more.

Torque and columns pass a low-pass with a third of that. Positions must keep what bends sharply,
such as the start of a trapezoid, or columns are wrong; the equation holds in any band, and its
noise is less in a narrow one.

A recorded velocity is taken if it says the same as the derivative of the position, and has less
noise below the cut-off.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import signal

from hil.estimation.free_motion.filtering import low_passed, reach
from hil.estimation.free_motion.motion import Processing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.survey import Survey
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

ABOVE = 100.0
"""Power of the motion over that of the noise, at the cut-off."""
SAMPLED = 0.125
"""Share of the sampling rate that the cut-off reaches at most."""
HIGHEST, LOWEST = 100.0, 1.0
"""Cut-off frequencies that are chosen [Hz]."""
EQUATION = 3.0
"""Cut-off frequency of the positions over that of torque and columns."""
WINDOW = 4.0
"""Length of the spectra's windows, at most [s]."""
FLOOR = 0.3
"""Share of the sampling rate from which on there is noise alone."""
SAME = 0.1
"""Difference of two velocities, over their size, up to which they are the same."""


def processing_of(found: Survey) -> tuple[Processing, str]:
    """Settings for all recordings, and why the cut-off is what it is."""
    period = found.stretches[0].period
    each = [bandwidth(part.q[:, axis], period) for part in _long(found) for axis in _moving(found)]
    cut_off, reason = cut_off_of(each, period, found.cut_off)
    return Processing(
        cut_off, cut_off / EQUATION, found.speed, _recorded_velocity(found, cut_off)
    ), reason


def cut_off_of(
    bandwidths: Sequence[float], period: float, stated: float | None
) -> tuple[float, str]:
    """Cut-off frequency of the positions [Hz], and why it is that.

    Parameters
    ----------
    bandwidths : sequence of float
        Of positions, by `bandwidth` [Hz].
    period : float
        Between samples [s].
    stated : float or None
        In the map [Hz].
    """
    cut_off, reason = (stated, "stated in the map") if stated else _chosen(bandwidths, period)
    # stated or not, a filter needs samples
    most = 0.25 / period
    if cut_off > most:
        return most, f"{reason}, but at most a quarter of the sampling rate"
    return cut_off, reason


def _chosen(bandwidths: Sequence[float], period: float) -> tuple[float, str]:
    most = min(SAMPLED / period, HIGHEST)
    wanted = float(np.median(bandwidths)) if bandwidths else most
    if wanted > most:
        return most, "the motion stands out from noise at all frequencies that samples show"
    return max(wanted, LOWEST), (
        f"up to it the positions' spectrum is {ABOVE:g} times the noise or more"
    )


def _long(found: Survey) -> list[Recording]:
    """Longest stretches, which show most."""
    return sorted(found.stretches, key=lambda part: -part.n_samples)[:10]


def _moving(found: Survey) -> list[int]:
    return [axis for axis in range(len(found.speed)) if axis not in found.still]


def bandwidth(x: Array, period: float) -> float:
    """Frequency up to which a signal stands out from its noise [Hz]."""
    f, power = _spectrum(x, period)
    low = np.flatnonzero(power[2:] < ABOVE * _floor(f, power, period))
    return float(f[2 + low[0]]) if len(low) else float(f[-1])


def _spectrum(x: Array, period: float) -> tuple[Array, Array]:
    n = min(len(x) // 4, round(WINDOW / period))
    f, power = signal.welch(signal.detrend(x), 1.0 / period, nperseg=max(n, 8))
    return f, power


def _floor(f: Array, power: Array, period: float) -> float:
    return float(np.median(power[f > FLOOR / period]))


def _recorded_velocity(found: Survey, cut_off: float) -> Mask:
    """Axes whose recorded velocity is better in most of the stretches."""
    votes = [
        _better(part, cut_off) for part in _long(found) if part.qd is not None and part.n_samples
    ]
    if len(votes) < len(_long(found)) or not votes:
        return np.zeros(len(found.speed), dtype=bool)
    return np.asarray(np.mean(votes, axis=0) > 0.5)


def _better(part: Recording, cut_off: float) -> Mask:
    """Axes whose recorded velocity says the same as the derivative, with less noise."""
    if part.qd is None:
        return np.zeros(part.n_joints, dtype=bool)
    period = part.period
    edge = reach(period, cut_off)
    derived = low_passed(part.q, period, cut_off, derivatives=1)[1][edge:-edge]
    recorded = low_passed(part.qd, period, cut_off)[0][edge:-edge]
    size = np.sqrt(np.mean(derived**2, axis=0))
    same = np.sqrt(np.mean((derived - recorded) ** 2, axis=0)) <= SAME * size
    return np.asarray(same & (size > 0) & (_noise(part.qd, period, cut_off, 0)
                                           < _noise(part.q, period, cut_off, 1)))  # fmt: skip


def _noise(x: Array, period: float, cut_off: float, derivatives: int) -> Array:
    """Mean square of each column's noise below the cut-off, after so many derivatives."""
    k = 2 * derivatives
    band = (2 * np.pi) ** k * cut_off ** (k + 1) / (k + 1)
    return np.array([_floor(*_spectrum(column, period), period) for column in x.T]) * band
