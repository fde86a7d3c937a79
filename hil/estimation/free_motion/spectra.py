"""Spectrum of a signal, and the floor of noise in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import signal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

WINDOW = 4.0
"""Length of the spectra's windows, at most [s]."""
FLOOR = 0.3
"""Share of the sampling rate from which on there is noise alone."""


def spectrum(x: Array, period: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and power density of samples (n,) every `period` [s]."""
    n = min(len(x) // 4, round(WINDOW / period))
    f, power = signal.welch(signal.detrend(x), 1.0 / period, nperseg=max(n, 8))
    return f, power


def floor(f: Array, power: Array, period: float) -> float:
    """Power density of the noise: its median where nothing moves."""
    return float(np.median(power[f > FLOOR / period]))
