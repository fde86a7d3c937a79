"""One low-pass for everything, and decimation.

The filter is a Butterworth filter of order four run forth and back: phase zero and the magnitude

    |H(f)|^2 = 1 / (1 + (f / f_c)^8)

at the cut-off frequency f_c. Applied to spectra it differentiates and decimates in the same step,
for what remains above twice the cut-off is next to nothing. Positions pass it to be differentiated,
at `FINE` samples a period of the cut-off; torque and columns of the regressor pass it again, since
products of filtered signals have higher frequencies than these, and are kept at `COARSE` samples.

Both ends of a recording are continued by point reflection, so that positions and velocities go on
without a step. Whatever the filter mixes with that, `REACH` periods of the cut-off for each pass,
is dropped afterwards: no fit sees a reflected sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FINE = 8.0
"""Samples of the motion in a period of its cut-off frequency, at least."""
COARSE = 4.0
"""Samples that are used in a period of the equation's cut-off frequency, at least."""
REACH = 2.0
"""Periods of the cut-off frequency after which the filter's response is below a hundredth."""
ORDER = 4
"""Of the filter that runs forth and back."""


@dataclass(frozen=True, slots=True)
class Rates:
    """Periods of the samples of one recording, before and after decimation [s].

    Attributes
    ----------
    period : float
        As recorded.
    fine, coarse : int
        Every n-th sample of the recording is one of the motion; every n-th of these is used.
    """

    period: float
    fine: int
    coarse: int

    @classmethod
    def of(cls, period: float, cut_off: float, band: float) -> Rates:
        """Rates for samples every `period` [s], cut-offs of the motion and of the equation [Hz]."""
        fine = max(1, int(1.0 / (FINE * cut_off * period)))
        return cls(period, fine, max(1, int(1.0 / (COARSE * band * period * fine))))


def low_passed(
    x: Array,
    period: float,
    cut_off: float,
    every: int = 1,
    derivatives: int = 0,
    ahead: Array | None = None,
) -> tuple[Array, ...]:
    """Low-pass of columns of samples, and of their derivatives.

    Parameters
    ----------
    x : ndarray, shape (n, k)
        Samples every `period` [s].
    cut_off : float
        [Hz].
    every : int
        Of the result every n-th sample is wanted.
    derivatives : int
        How many derivatives are wanted.
    ahead : ndarray, shape (k,), optional
        How much later than its instant each column is taken [s]; short against `reach`.

    Returns
    -------
    tuple of ndarray, shape (ceil(n / every), k)
        The columns filtered, then their derivatives, per second each time.
    """
    n, pad = len(x), _padding(len(x), period, cut_off, every)
    whole = every * fft.next_fast_len(-(-(n + 2 * pad) // every), real=True)
    spectrum = fft.rfft(_continued(x, pad, whole).T)
    frequencies = fft.rfftfreq(whole, period)
    spectrum *= 1.0 / (1.0 + (frequencies / cut_off) ** (2 * ORDER))
    if ahead is not None:
        spectrum = spectrum * np.exp(2j * np.pi * np.outer(ahead, frequencies))
    kept, found = whole // every, []
    for _ in range(derivatives + 1):
        part = spectrum[:, : kept // 2 + 1]
        found.append(fft.irfft(part, kept).T[pad // every :][: -(-n // every)] / every)
        spectrum = spectrum * (2j * np.pi * frequencies)
    return tuple(found)


def reach(period: float, cut_off: float) -> int:
    """Samples every `period` [s] over which one pass of the filter spreads what is wrong."""
    return int(np.ceil(REACH / (cut_off * period)))


def _padding(n: int, period: float, cut_off: float, every: int) -> int:
    """Samples added at either end: a multiple of `every`."""
    return every * (min(2 * reach(period, cut_off), n - 1) // every)


def _continued(x: Array, pad: int, whole: int) -> Array:
    """Point reflections at both ends, and a ramp back from the last value to the first."""
    before, after = 2 * x[0] - x[pad:0:-1], 2 * x[-1] - x[-2 : -2 - pad : -1]
    body = np.concatenate([before, x, after])
    share = np.linspace(0.0, 1.0, whole - len(body) + 2)[1:-1, np.newaxis]
    return np.concatenate([body, (1.0 - share) * body[-1] + share * body[0]])
