"""One recording as a fit takes it: positions, velocities, accelerations and torque, filtered.

There is one low-pass for everything, with decimation: a Butterworth filter of order four run forth
and back, phase zero and the magnitude

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
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft, ndimage

from hil.friction.direction import bent, friction_direction, sign_of_velocity

if TYPE_CHECKING:
    from hil.arrays import Array, Indices, Mask
    from hil.friction.direction import Direction
    from hil.runs.recording import Recording

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
    # what does not change passes as it is
    changes = np.flatnonzero(changing(x))
    kept, n_kept = whole // every, -(-n // every)
    frequencies, gain = _response(whole, kept, period, cut_off)
    continued = _continued(x, changes, pad, whole)
    spectrum = fft.rfft(continued, overwrite_x=True)[:, : kept // 2 + 1]
    spectrum *= gain / every
    if ahead is not None:
        spectrum *= np.exp(2j * np.pi * np.outer(ahead[changes], frequencies))
    found = []
    for order in range(derivatives + 1):
        if order:
            spectrum *= 2j * np.pi * frequencies
        passed = np.empty((x.shape[1], n_kept))
        passed[:] = x[:1].T * (order == 0)
        passed[changes] = fft.irfft(spectrum, kept)[:, pad // every :][:, :n_kept]
        found.append(passed.T)
    return tuple(found)


def changing(x: Array) -> Mask:
    """Whether columns of samples, shape (n, k), are anything else than constant, shape (k,)."""
    columns = x.T
    found: Mask = (columns[:, ::50] != columns[:, :1]).any(axis=1)  # most show it at once
    others = np.flatnonzero(~found)
    found[others] = (columns[others] != columns[others, :1]).any(axis=1)
    return found


@lru_cache(maxsize=16)
def _response(whole: int, kept: int, period: float, cut_off: float) -> tuple[Array, Array]:
    """Frequencies that are kept of a spectrum of `whole` samples [Hz], and their gain."""
    frequencies = fft.rfftfreq(whole, period)[: kept // 2 + 1]
    return frequencies, 1.0 / (1.0 + (frequencies / cut_off) ** (2 * ORDER))


def reach(period: float, cut_off: float) -> int:
    """Samples every `period` [s] over which one pass of the filter spreads what is wrong."""
    return int(np.ceil(REACH / (cut_off * period)))


def _padding(n: int, period: float, cut_off: float, every: int) -> int:
    """Samples added at either end: a multiple of `every`."""
    return every * (min(2 * reach(period, cut_off), n - 1) // every)


def _continued(x: Array, columns: Indices, pad: int, whole: int) -> Array:
    """Point reflections at both ends, and a ramp from the last value to the first: (k, whole)."""
    n = len(x)
    body = np.empty((len(columns), whole))
    inner = body[:, pad : pad + n]
    for row, k in zip(inner, columns, strict=True):
        row[:] = x[:, k]
    first, last = inner[:, :1], inner[:, -1:]
    body[:, :pad] = 2 * first - inner[:, pad:0:-1]
    body[:, pad + n : 2 * pad + n] = 2 * last - inner[:, -2 : -2 - pad : -1]
    share = np.linspace(0.0, 1.0, whole - n - 2 * pad + 2)[1:-1]
    begin, end = body[:, :1], body[:, 2 * pad + n - 1 : 2 * pad + n]
    body[:, 2 * pad + n :] = (1.0 - share) * end + share * begin
    return body


@dataclass(frozen=True, slots=True, eq=False)
class Processing:
    """How recordings become signals; the same for all recordings of an estimate.

    Attributes
    ----------
    cut_off : float
        Of the low-pass of positions and velocities [Hz].
    band : float
        Of the low-pass of torque and columns [Hz].
    speed : ndarray, shape (n_joints,)
        Speed that each axis hardly ever exceeds [rad/s or m/s]: the unit of friction's columns.
    recorded_velocity : ndarray of bool, shape (n_joints,)
        Axes whose velocity is taken as it was recorded, where it was, instead of from the position.
    presliding : ndarray, shape (n_joints,)
        Distance over which friction turns round after a reversal [rad or m]; 0 for at once.
    lag : ndarray, shape (n_joints,)
        By which the recorded torque comes after the position [s]; taken back.
    soft : tuple of int
        Axes, from 0, whose gears give way.
    """

    cut_off: float
    band: float
    speed: Array
    recorded_velocity: Mask
    presliding: Array
    lag: Array
    soft: tuple[int, ...] = ()

    def spoilt(self, period: float) -> int:
        """Samples every `period` [s] at either end that reflected ones have reached."""
        return reach(period, self.cut_off) + reach(period, self.band)


@dataclass(frozen=True, eq=False)
class Motion:
    """Filtered motion of one recording.

    Attributes
    ----------
    processing : Processing
    rates : Rates
    q, qd, qdd : ndarray, shape (n, n_joints)
        [rad or m], at `rates.fine`.
    tau : ndarray, shape (n_used, n_joints)
        Torque, filtered and its lag taken back [N m or N], at `rates.coarse`.
    used : ndarray of bool, shape (n_used,)
        Samples that no reflected sample has reached.
    recording : Recording
        Where it comes from.
    offset : int
        Half of its samples that the motion comes from, as of `filtered_motion`.
    """

    processing: Processing
    rates: Rates
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    used: Mask
    recording: Recording
    offset: int = 0

    @cached_property
    def smooth(self) -> Array:
        """Positions at the recording's own rate, filtered, shape (n_recorded, n_joints)."""
        q = _every_other(self.recording.q, self.offset)
        return low_passed(q, self.rates.period, self.processing.cut_off)[0]

    def half(self, offset: int) -> Motion:
        """The same from every other sample of the recording, as of `filtered_motion`."""
        return filtered_motion(self.recording, self.processing, offset)

    @property
    def period(self) -> float:
        """Between samples of the motion [s]."""
        return self.rates.period * self.rates.fine

    @property
    def spoilt(self) -> float:
        """Time at both ends together that reflected samples have reached [s]."""
        every = self.period * self.rates.coarse
        return 2 * self.processing.spoilt(every) * every

    @property
    def duration(self) -> float:
        """Of the samples that are used [s]."""
        return int(self.used.sum()) * self.period * self.rates.coarse

    @cached_property
    def directions(self) -> tuple[Direction, ...]:
        """Direction of each axis's friction."""
        return tuple(
            bent(partial(self.direction_after, axis), float(distance))
            for axis, distance in enumerate(self.processing.presliding)
        )

    def direction_after(self, axis: int, distance: float) -> Array:
        """Direction of one axis's friction with some presliding distance, shape (n,).

        With none it is the sign of the velocity, 0 at rest. Else it comes from the way at the
        recording's own rate, for reversals are quick.
        """
        if distance == 0:
            return sign_of_velocity(self.qd[:, axis], self.processing.speed[axis])
        z = friction_direction(self.smooth[:, axis], distance)[:, np.newaxis]
        rates = self.rates
        return low_passed(z, rates.period, self.processing.cut_off, rates.fine)[0][:, 0]

    @property
    def slowest(self) -> Array:
        """Least speed nearby as a share of the axis's speed, shape (n_used, n_joints).

        Nearby is as far as the filter carries what happens at a reversal.
        """
        width = 2 * int(1.0 / (self.processing.band * self.period)) + 1
        least = ndimage.minimum_filter1d(np.abs(self.qd), width, axis=0) / self.processing.speed
        return np.asarray(least[:: self.rates.coarse])

    def passed(self, x: Array) -> Array:
        """Columns of the motion's samples, filtered, at the samples that are used."""
        return low_passed(x, self.period, self.processing.band, self.rates.coarse)[0]


def filtered_motion(recording: Recording, processing: Processing, offset: int = 0) -> Motion:
    """Filter a recording.

    Parameters
    ----------
    recording : Recording
        Even in time, without a gap.
    offset : int
        Where not 0 the motion comes from every other sample of the recording, from 0 on for 1 and
        from 1 on for 2, brought to the same instants: two motions whose errors of measurement have
        nothing to do with each other.
    """
    period, band = recording.period, processing.band
    rates = Rates.of(period, processing.cut_off, band)
    q, qd, qdd = _motion(recording, processing, rates, offset)
    every, lag = rates.fine * rates.coarse, processing.lag
    tau = low_passed(recording.tau, period, band, every, ahead=lag if lag.any() else None)[0]
    spoilt = processing.spoilt(period * every)
    used = np.zeros(len(tau), dtype=bool)
    used[spoilt : len(tau) - spoilt] = True
    return Motion(processing, rates, q, qd, qdd, tau, used, recording, offset)


def _motion(
    recording: Recording, processing: Processing, rates: Rates, offset: int
) -> tuple[Array, Array, Array]:
    def passed(x: Array, derivatives: int) -> tuple[Array, ...]:
        x = _every_other(x, offset)
        return low_passed(x, recording.period, processing.cut_off, rates.fine, derivatives)

    q, qd, qdd = passed(recording.q, 2)
    if recording.qd is None:
        return q, qd, qdd
    taken = processing.recorded_velocity & np.isfinite(recording.qd).all(axis=0)
    if taken.any():
        qd[:, taken], qdd[:, taken] = passed(recording.qd[:, taken], 1)
    return q, qd, qdd


def _every_other(x: Array, offset: int) -> Array:
    """Samples of one half, and between them what a parabola through their neighbours gives."""
    if not offset:
        return x
    kept, made = x.copy(), np.arange(offset % 2, len(x), 2)
    inner = made[(made >= 3) & (made < len(x) - 3)]
    kept[inner] = (9 * (x[inner - 1] + x[inner + 1]) - x[inner - 3] - x[inner + 3]) / 16
    return kept
