"""Filter a recording: positions, velocities, accelerations and torque for a fit.

One type of low-pass with decimation is used throughout: a Butterworth filter run forth and back,
with zero phase and the magnitude

    |H(f)|^2 = 1 / (1 + (f / f_c)^n)

at the cut-off frequency f_c. Applied to spectra, the filter differentiates and decimates in the
same step, since the response above twice the cut-off is negligible. Positions are filtered for
differentiation, with `FINE` samples in a period of the cut-off; torque and columns of the regressor
are filtered again, since products of filtered signals have higher frequencies, and are kept at
`COARSE` samples. The torque does not pass the filter of the positions, so n of the latter is large
enough for the band of the equation (`Processing.steepness`): accelerations of coarse encoders, 4 %
too small at its edge with n = 8, looked like soft gears and delays.

Both ends of a recording are continued by point reflection, so that positions and velocities have no
step. Samples mixed with the reflection by the filter (`reach`) are dropped afterwards: no fit sees
a reflected sample.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy import fft

from hil.friction.direction import bent, friction_direction, sign_of_velocity
from hil.friction.law import SLOWEST
from hil.least_squares.standstill import braked, limited
from hil.least_squares.window import widen

if TYPE_CHECKING:
    from hil.arrays import Array, Mask
    from hil.friction.direction import Direction
    from hil.runs.recording import Recording

Rests = Literal["used", "level", "left out"]
FINE = 8.0
"""Fewest samples of the motion in a period of the cut-off frequency."""
COARSE = 4.0
"""Fewest used samples in a period of the equation's cut-off frequency."""
BANDS = 3.0
"""Cut-off frequency of the positions over that of torque and columns."""
REACH = 2.0
"""Periods of the cut-off frequency until the response of the least order is below a hundredth."""
SAME = 0.1
"""Largest relative difference of two equal velocities."""
LAG = 0.5
"""Largest accepted lag of a recorded velocity, in periods: that of the difference of two samples.
"""
ORDER = 4
"""Least order of the filter run forth and back; n is twice as large."""
FLAT = 1e-3
"""Largest share of a motion that the filter of the positions takes within the equation's band.

With 1/300 and 1/3000, twins with encoders of 10 and 12 bit get the same verdicts."""


@dataclass(frozen=True, slots=True)
class Rates:
    """Sampling periods of a recording, before and after decimation [s].

    Attributes
    ----------
    period : float
        Recorded sampling period.
    fine, coarse : int
        Decimation factors: from the recording to the motion, from the motion to the used samples.
    """

    period: float
    fine: int
    coarse: int

    @classmethod
    def choose(cls, period: float, cut_off: float, band: float) -> Rates:
        """Choose rates for a `period` [s] and cut-offs of motion and equation [Hz]."""
        fine = max(1, int(1.0 / (FINE * cut_off * period)))
        return cls(period, fine, max(1, int(1.0 / (COARSE * band * period * fine))))


def low_passed(
    x: Array,
    period: float,
    cut_off: float,
    every: int = 1,
    derivatives: int = 0,
    ahead: Array | None = None,
    steepness: float = 2.0 * ORDER,
) -> tuple[Array, ...]:
    """Filter columns of samples by the low-pass, and differentiate.

    Parameters
    ----------
    x : ndarray, shape (n, k)
        Samples every `period` [s].
    cut_off : float
        Cut-off frequency [Hz].
    every : int
        Decimation factor of the result.
    derivatives : int
        Number of derivatives.
    ahead : ndarray, shape (k,), optional
        Time shift of each column, towards later samples [s]; short against `reach`.
    steepness : float
        n of the filter.

    Returns
    -------
    tuple of ndarray, shape (ceil(n / every), k)
        The filtered columns, then the derivatives with respect to time.
    """
    n = len(x)
    # samples added at either end, a multiple of `every`
    pad = every * (min(2 * reach(period, cut_off, steepness), n - 1) // every)
    whole = every * fft.next_fast_len(-(-(n + 2 * pad) // every), real=True)
    # constant columns need no filter
    changes = np.flatnonzero(changing(x))
    kept, n_kept = whole // every, -(-n // every)
    frequencies, gain = _response(whole, kept, period, cut_off, steepness)
    # continue columns by point reflections and a ramp to the first value, (k, whole)
    n = len(x)
    body = np.empty((len(changes), whole))
    inner = body[:, pad : pad + n]
    for row, k in zip(inner, changes, strict=True):
        row[:] = x[:, k]
    first, last = inner[:, :1], inner[:, -1:]
    body[:, :pad] = 2 * first - inner[:, pad:0:-1]
    body[:, pad + n : 2 * pad + n] = 2 * last - inner[:, -2 : -2 - pad : -1]
    share = np.linspace(0.0, 1.0, whole - n - 2 * pad + 2)[1:-1]
    begin, end = body[:, :1], body[:, 2 * pad + n - 1 : 2 * pad + n]
    body[:, 2 * pad + n :] = (1.0 - share) * end + share * begin
    spectrum = fft.rfft(body, overwrite_x=True)[:, : kept // 2 + 1]
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
    """Return True for every column of samples (n, k) that is not constant, shape (k,)."""
    columns = x.T
    found: Mask = (columns[:, ::50] != columns[:, :1]).any(axis=1)  # most change within this subset
    others = np.flatnonzero(~found)
    found[others] = (columns[others] != columns[others, :1]).any(axis=1)
    return found


@lru_cache(maxsize=16)
def _response(
    whole: int, kept: int, period: float, cut_off: float, steepness: float
) -> tuple[Array, Array]:
    """Return the kept frequencies of a spectrum of `whole` samples [Hz], and the gain."""
    frequencies = fft.rfftfreq(whole, period)[: kept // 2 + 1]
    return frequencies, 1.0 / (1.0 + (frequencies / cut_off) ** steepness)


def reach(period: float, cut_off: float, steepness: float = 2.0 * ORDER) -> int:
    """Return the number of samples affected by a disturbance in one filter pass.

    The slowest pole of the filter decays by exp(-2 pi sin(pi / n)) in a period of the cut-off.
    """
    periods = REACH * np.sin(np.pi / (2.0 * ORDER)) / np.sin(np.pi / steepness)
    return int(np.ceil(periods / (cut_off * period)))


@dataclass(frozen=True, slots=True, eq=False)
class Processing:
    """Settings of signal processing, common to the recordings of an estimate.

    Attributes
    ----------
    cut_off : float
        Cut-off frequency of the low-pass of positions and velocities [Hz].
    band : float
        Cut-off frequency of the low-pass of torque and columns [Hz].
    speed : ndarray, shape (n_joints,)
        Reference speed of each axis, exceeded by few samples [rad/s or m/s]: the unit of friction's
        columns.
    recorded_velocity : ndarray of bool, shape (n_joints,)
        Axes with the recorded velocity, if present, in place of the derivative of the position.
    presliding : ndarray, shape (n_joints,)
        Presliding distance after a reversal [rad or m]; 0 for immediate reversal of friction.
    lag : ndarray, shape (n_joints,)
        Delay of the recorded torque after the position [s]; compensated.
    soft : tuple of int
        Axes with soft gears, from 0.
    rest : ndarray, shape (n_joints,), optional
        Positions of axes at rest [rad or m], NaN for the others; by default none rests.
    held : tuple of int
        Axes at rest, from 0, whose torque is not used (`hil.estimation.free_motion.choice`).
    rests : str
        Use of the torque while a moving axis rests: "used", but for its "level" over a long rest,
        or "left out" (`hil.estimation.free_motion.gathering`).
    """

    cut_off: float
    band: float
    speed: Array
    recorded_velocity: Mask
    presliding: Array
    lag: Array
    soft: tuple[int, ...] = ()
    rest: Array | None = None
    held: tuple[int, ...] = ()
    rests: Rests = "used"

    @property
    def steepness(self) -> float:
        """The n of the filter of positions: at most `FLAT` is lost in the equation's band."""
        if self.cut_off <= self.band:  # the torque has passed the same filter
            return 2.0 * ORDER
        return max(2.0 * ORDER, -float(np.log(FLAT) / np.log(self.cut_off / self.band)))

    def smoothed(
        self,
        x: Array,
        period: float,
        every: int = 1,
        derivatives: int = 0,
        ahead: Array | None = None,
    ) -> tuple[Array, ...]:
        """Filter columns of samples like the positions (`low_passed`)."""
        return low_passed(x, period, self.cut_off, every, derivatives, ahead, self.steepness)

    def moves(self, qd: Array) -> Mask:
        """Return a mask of velocities (..., n_joints) of axes that do not rest."""
        return np.asarray(np.abs(qd) >= SLOWEST * self.speed)

    def spoilt(self, period: float) -> int:
        """Return the number of samples at either end affected by reflected samples."""
        return reach(period, self.cut_off, self.steepness) + reach(period, self.band)


@dataclass(frozen=True, eq=False)
class Motion:
    """Filtered motion of a recording.

    Attributes
    ----------
    q, qd, qdd : ndarray, shape (n, n_joints)
        Motion [rad or m, per s and per s^2], at `rates.fine`.
    tau : ndarray, shape (n_used, n_joints)
        Torque, filtered and with compensated lag [N m or N], at `rates.coarse`.
    used : ndarray of bool, shape (n_used,)
        Samples unaffected by reflected samples.
    telling : ndarray of bool, shape (n_used, n_joints)
        Samples whose torque is used: not with a closed brake, at a limit, or while the axis rests.
    recording : Recording
        Source of the motion.
    offset : int
        Half of the samples used, see `filtered_motion`.
    window : ndarray, shape (n_recorded, n_joints), optional
        Factor of torque and columns before they are filtered, 0 where torque is not used.
    """

    processing: Processing
    rates: Rates
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    used: Mask
    telling: Mask
    recording: Recording
    offset: int = 0
    window: Array | None = None

    @cached_property
    def smooth(self) -> Array:
        """Filtered positions at the recording's sampling rate, shape (n_recorded, n_joints)."""
        q = _every_other(self.recording.q, self.offset)
        return self.processing.smoothed(q, self.rates.period)[0]

    def half(self, offset: int) -> Motion:
        """Return the motion from half of the samples of the recording, see `filtered_motion`."""
        return filtered_motion(self.recording, self.processing, offset)

    @property
    def period(self) -> float:
        """Sampling period of the motion [s]."""
        return self.rates.period * self.rates.fine

    @property
    def spoilt(self) -> float:
        """Total time at both ends affected by reflected samples [s]."""
        every = self.period * self.rates.coarse
        return 2 * self.processing.spoilt(every) * every

    @property
    def duration(self) -> float:
        """Duration of the used samples [s]."""
        return int(self.used.sum()) * self.period * self.rates.coarse

    @cached_property
    def directions(self) -> tuple[Direction, ...]:
        """Friction direction of every axis."""
        return tuple(
            bent(partial(self.direction_after, axis), float(distance))
            for axis, distance in enumerate(self.processing.presliding)
        )

    def direction_after(self, axis: int, distance: float) -> Array:
        """Return the friction direction of an axis for a presliding distance, shape (n,).

        Without presliding the direction is the sign of the velocity, 0 at rest. Otherwise it
        follows from the path at the sampling rate of the recording, since reversals are quick.
        """
        if distance == 0:
            return sign_of_velocity(self.qd[:, axis], self.processing.speed[axis])
        z = friction_direction(self.smooth[:, axis], distance)[:, np.newaxis]
        return self.processing.smoothed(z, self.rates.period, self.rates.fine)[0][:, 0]

    @property
    def slowest(self) -> Array:
        """Lowest nearby speed as a share of the axis's speed, shape (n_used, n_joints).

        Nearby means within the reach of the filter around a reversal, where torque is used.
        """
        from scipy import ndimage  # noqa: PLC0415 - takes long to load

        width, speed = 2 * int(1.0 / (self.processing.band * self.period)) + 1, np.abs(self.qd)
        if self.window is not None:
            speed = np.where(self.window[:: self.rates.fine] > 0.0, speed, np.inf)
        least = ndimage.minimum_filter1d(speed, width, axis=0) / self.processing.speed
        return np.asarray(least[:: self.rates.coarse])

    def passed(self, x: Array, axis: int | None = None) -> Array:
        """Filter columns of the motion's samples, decimated to the used samples.

        Columns are those of an `axis`, or one for every axis.
        """
        if self.window is not None:
            window = self.window[:: self.rates.fine]
            x = x * (window if axis is None else window[:, [axis]])
        return low_passed(x, self.period, self.processing.band, self.rates.coarse)[0]


def filtered_motion(recording: Recording, processing: Processing, offset: int = 0) -> Motion:
    """Filter a recording.

    Parameters
    ----------
    recording : Recording
        Recording with constant sampling period and without gaps.
    offset : int
        If not 0, the motion comes from every second sample of the recording, from 0 on for 1 and
        from 1 on for 2, interpolated to the same instants: two motions with independent measurement
        errors.
    """
    period, band = recording.period, processing.band
    rates = Rates.choose(period, processing.cut_off, band)

    def passed(x: Array, derivatives: int, ahead: Array | None = None) -> tuple[Array, ...]:
        x = _every_other(x, offset)
        return processing.smoothed(x, period, rates.fine, derivatives, ahead)

    q, qd, qdd = passed(recording.q, 2)
    if recording.qd is not None:
        taken = processing.recorded_velocity & np.isfinite(recording.qd).all(axis=0)
        if taken.any():
            (recorded,) = passed(of := recording.qd[:, taken], 0)
            late = velocity_lags(qd[:, taken], qdd[:, taken], recorded)
            late = late.clip(-LAG * period, LAG * period)  # anything for an axis at rest
            qd[:, taken], qdd[:, taken] = passed(of, 1, late)
    if processing.rest is not None:
        # the noise of an axis at rest would seem to excite parameters
        still = np.isfinite(processing.rest)
        q[:, still], qd[:, still], qdd[:, still] = processing.rest[still], 0.0, 0.0
    every = rates.fine * rates.coarse
    moves = np.repeat(processing.moves(qd), rates.fine, axis=0)[: len(recording.q)]
    window = _window(recording, processing, moves)
    tau = filtered_torque(recording, band, every, processing.lag, window)
    spoilt = processing.spoilt(period * every)
    used = np.zeros(len(tau), dtype=bool)
    used[spoilt : len(tau) - spoilt] = True
    telling = np.ones(tau.shape, dtype=bool) if window is None else window[::every] >= 0.5
    return Motion(processing, rates, q, qd, qdd, tau, used, telling, recording, offset, window)


def velocity_lags(v: Array, a: Array, recorded: Array) -> Array:
    """Return the lags of recorded velocities [s], shape (n_joints,): positive if late.

    With derivatives v and a of the position, all low-passed and of shape (n, n_joints), a recorded
    velocity is scale (v - lag a), by least squares for any scale.
    """
    fits = [
        np.linalg.lstsq(np.stack([own, rate], axis=1), of, rcond=None)[0]
        for own, rate, of in zip(v.T, a.T, recorded.T, strict=True)
    ]
    return np.array([-shift / scale if abs(scale) > SAME else 0.0 for scale, shift in fits])


def smooth_positions(recording: Recording, cut_off: float) -> Recording:
    """Return a recording with low-passed positions, without the spoilt ends; cut-off in Hz."""
    arrays = recording.arrays | {"q": low_passed(recording.q, recording.period, cut_off)[0]}
    far = reach(recording.period, cut_off)
    return replace(recording, **{name: x[far : len(x) - far] for name, x in arrays.items()})


def _window(recording: Recording, processing: Processing, moves: Mask) -> Array | None:
    """Return `Motion.window`; None if torque is used throughout.

    The equation of motion holds in every sample, so also times a factor. Its slopes last a period
    of the cut-off, and so are smooth at the rate of the motion.
    """
    period = recording.period
    of = recording.q, recording.tau, period
    silent = braked(*of) | limited(*of)
    if processing.rests == "left out":
        # half a period of the equation's cut-off: a shorter stop is not resolved
        half = max(1, round(0.25 / (processing.band * period)))
        moved = np.ones(moves.shape[1]) if processing.rest is None else np.isnan(processing.rest)
        for axis in np.flatnonzero(moved).tolist():
            silent[:, axis] |= widen(~widen(moves[:, axis], half), half)
    if not silent.any():
        return None
    n = max(1, round(0.5 / (processing.cut_off * period)))
    slope = np.hanning(2 * n + 1) / n
    found = np.ones(silent.shape)
    for axis in np.flatnonzero(silent.any(axis=0)).tolist():
        free = np.pad(~widen(silent[:, axis], n), n, mode="edge")
        found[:, axis] = np.convolve(free, slope, "valid").clip(0.0, 1.0)
    return found


def filtered_torque(
    recording: Recording, band: float, every: int, lag: Array, window: Array | None = None
) -> Array:
    """Return the recorded torque, earlier by `lag` (n_joints,) [s], times `window`, filtered."""
    tau, ahead = recording.tau, lag if lag.any() else None
    if window is not None:
        t = recording.period * np.arange(len(tau))
        late = np.column_stack([np.interp(t + s, t, x) for s, x in zip(lag, tau.T, strict=True)])
        tau, ahead = window * late, None
    return low_passed(tau, recording.period, band, every, ahead=ahead)[0]


def _every_other(x: Array, offset: int) -> Array:
    """Replace every second sample by an interpolation through neighbouring samples."""
    if not offset:
        return x
    kept, made = x.copy(), np.arange(offset % 2, len(x), 2)
    inner = made[(made >= 3) & (made < len(x) - 3)]
    kept[inner] = (9 * (x[inner - 1] + x[inner + 1]) - x[inner - 3] - x[inner + 3]) / 16
    return kept
