"""Settings that the recordings deserve: cut-off frequency and source of the velocities.

The spectrum of a position falls until it drowns in the noise of its measurement, which is about the
same at all frequencies and alone near half the sampling rate. Up to where it stands `ABOVE` times
above that floor there is motion that is worth differentiating twice; beyond, accelerations become
noise. That is the cut-off frequency, the median over the axes, unless the map states one. It is at
most `SAMPLED` times the sampling rate and at most `HIGHEST`, where no arm is rigid any more.

Torque and columns pass a low-pass with a third of that. Positions must keep what bends sharply,
such as the start of a trapezoid, or columns are wrong; the equation holds in any band, and its
noise is less in a narrow one.

Which velocity is taken, `hil.estimation.free_motion.velocity_source` chooses joint by joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.motion import Processing
from hil.estimation.free_motion.spectra import floor, spectrum
from hil.estimation.free_motion.velocity_source import velocity_sources

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.survey import Survey
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

ABOVE = 100.0
"""Power of the motion over that of the noise, at the cut-off."""
SAMPLED = 0.125
"""Share of the sampling rate that the cut-off reaches at most."""
HIGHEST, LOWEST = 100.0, 1.0
"""Cut-off frequencies that are chosen [Hz]."""
EQUATION = 3.0
"""Cut-off frequency of the positions over that of torque and columns."""


@dataclass(frozen=True, slots=True)
class Reasons:
    """Why settings are what they are, in half sentences.

    Attributes
    ----------
    cut_off : str
    velocities : tuple of str
        Of each joint.
    """

    cut_off: str
    velocities: tuple[str, ...]


def processing_of(found: Survey) -> tuple[Processing, Reasons]:
    """Settings for all recordings, and why they are what they are."""
    period = found.stretches[0].period
    each = [bandwidth(part.q[:, axis], period) for part in _long(found) for axis in _moving(found)]
    cut_off, reason = cut_off_of(each, period, found.cut_off)
    sources = velocity_sources(_long(found), cut_off)
    recorded = np.array([source.recorded for source in sources])
    reasons = Reasons(reason, tuple(source.reason for source in sources))
    none = np.zeros(len(found.speed))
    return Processing(cut_off, cut_off / EQUATION, found.speed, recorded, none, none), reasons


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
    f, power = spectrum(x, period)
    low = np.flatnonzero(power[2:] < ABOVE * floor(f, power, period))
    return float(f[2 + low[0]]) if len(low) else float(f[-1])
