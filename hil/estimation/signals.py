"""Convert samples to signals: differentiation and filters (section 7.1).

Velocities and accelerations are differences of position, of fourth order in the sampling period:
second-order differences cause errors of percents in the inertias at typical bus rates. Differences
are taken from the unfiltered position; afterwards torque and columns of the regressor pass the same
low-pass, so that the filter affects both sides of the equation equally.

Two low-passes are available. The paper's is a "non-causal, phase-neutral eighth-order Butterworth
low-pass". Here that is a Butterworth filter of order four run forth and back: zero phase, magnitude
of order eight, 6 dB down at the cut-off frequency (`Signals.filtered`). Forth and back the filter
multiplies a spectrum by a real number,

    |H(f)|^2 = 1 / (1 + (tan(pi f T) / tan(pi f_c T))^8),

the bilinear transform of the analogue filter for samples every T, and is applied in this form: to
the spectra of all columns at once. Its response rings longer than a reversal of friction lasts. So
the improved method uses a Blackman window instead, which is phase-neutral and short
(`Signals.smoothed`, `hil.least_squares.window`).

No reflected or extrapolated value affects a result: recordings begin and end with samples at rest,
and samples within the reach of the filters from an end or a missing sample are marked invalid.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar, cast
from weakref import WeakKeyDictionary

import numpy as np
from scipy import fft

from hil.errors import NotEnoughData
from hil.friction.equation import base_rows, moving, term_columns, usable
from hil.least_squares.window import FIRST, SECOND, correlate, half_window, smooth, widen
from hil.runs.recording import active_samples

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array, Mask
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion
    from hil.runs.recording import Recording

    Prepared = Sequence[tuple[ParameterMotion, "Signals"]]
    """Measurements with signals."""

Kept = TypeVar("Kept")

CUTOFF = 30.0
"""Cut-off frequency of the low-pass [Hz]."""
ORDER = 4
"""Order of the filter run forth and back."""


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """Signals of a measurement on an even time grid, differentiated but not filtered.

    Attributes
    ----------
    period : float
        Sampling period [s].
    time : ndarray, shape (n,)
        Time [s].
    q, qd, qdd, tau : ndarray, shape (n, n_joints)
        [rad], [rad/s], [rad/s^2], [N m]; interpolated over missing samples.
    stroke, partner_stroke : ndarray, shape (n,)
        As in the recording.
    valid : ndarray of bool, shape (n,)
        Samples unaffected by the ends of the recording and by missing samples.
    twist : ndarray, shape (n, n_joints), optional
        Twist angle of each gear [rad]; None for rigid gears.
    group : ndarray, shape (n,), optional
        As in the recording.
    recorded : ndarray, shape (n_recorded, n_joints), optional
        Positions as recorded, NaN for missing ones [rad].
    kept : dict
        Cache of values computed from the motion alone (`once`).
    """

    period: float
    time: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    stroke: NDArray[np.int16]
    partner_stroke: NDArray[np.int16]
    valid: Mask
    twist: Array | None = None
    group: NDArray[np.int16] | None = None
    recorded: Array | None = None
    kept: dict[Hashable, tuple[tuple[Any, ...], object]] = field(default_factory=dict, repr=False)

    @property
    def active(self) -> Mask:
        """Mask of the samples of a stroke or a group, shape (n,)."""
        return active_samples(self.stroke, self.group)

    @property
    def link(self) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations on the link side, each (n, n_joints)."""
        if self.twist is None:
            return self.q, self.qd, self.qdd
        qd, qdd = derivatives(self.twist, self.period)
        return self.q - self.twist, self.qd - qd, self.qdd - qdd

    def once(self, key: Hashable, made: Callable[[], Kept]) -> Kept:
        """Return a cached function of the motion, computed a single time per key for any torque."""
        motion = self.q, self.qd, self.qdd, self.twist
        of, value = self.kept.get(key, ((), None))
        if len(of) != len(motion) or any(a is not b for a, b in zip(of, motion, strict=True)):
            value = made()
            self.kept[key] = motion, value
        return cast("Kept", value)

    @property
    def resolution(self) -> Array:
        """Smallest difference of positions: the encoder's step, shape (n_joints,) [rad]."""
        q = self.q if self.recorded is None else self.recorded
        return self.once("resolution", lambda: np.array([_least_difference(own) for own in q.T]))

    def moving(self, robot: Robot, axis: int) -> Mask:
        """Return valid samples of an axis away from reversals, shape (n,)."""
        return self.valid & self.once((moving, robot, axis), lambda: moving(robot, self, axis))

    def usable(self, robot: Robot, axis: int) -> Mask:
        """Return valid samples away from reversals and corners of the motion, shape (n,)."""
        return self.valid & self.once((usable, robot, axis), lambda: usable(robot, self, axis))

    def terms(self, robot: Robot, axis: int) -> tuple[Array, Array, Array]:
        """Return the columns of an axis (`hil.friction.equation.term_columns`)."""
        rows = self.once((base_rows, robot, axis), lambda: base_rows(robot, self, axis))
        return term_columns(robot, self, axis, rows)

    def drop_rows(self) -> None:
        """Drop the regressor rows of `terms` from the cache: most of the cache's memory."""
        for key in [key for key in self.kept if isinstance(key, tuple) and key[0] is base_rows]:
            del self.kept[key]

    def filtered(self, x: Array) -> Array:
        """Filter by the Butterworth low-pass along the first axis."""
        if self.period * CUTOFF >= 0.5:
            return x
        # time until the filter's response is below rounding [s]
        first = round(0.5 / self.period)
        n = fft.next_fast_len(len(x) + 2 * first, real=True)
        ends = [(first, n - len(x) - first)] + [(0, 0)] * (x.ndim - 1)
        spectrum = fft.rfft(np.pad(x, ends, mode="edge").T)
        filtered: Array = fft.irfft(spectrum * _forth_and_back(n, self.period), n).T
        return filtered[first : first + len(x)]

    def smoothed(self, x: Array) -> Array:
        """Return a weighted mean over a Blackman window along the first axis."""
        return smooth(x, self.period)

    def torque_advanced(self, lag: Array) -> Signals:
        """Return signals with torques advanced by `lag`, shape (n_joints,) [s]."""
        tau, widest = self.tau.copy(), 0
        for axis in np.flatnonzero(lag):
            first, weights = interpolation(float(lag[axis]) / self.period)
            taps = first + np.arange(len(weights))
            reach = int(np.abs(taps).max())
            padded = np.pad(self.tau[:, axis], reach, mode="edge")
            parts = [padded[reach + k : reach + k + len(tau)] for k in taps]
            tau[:, axis] = weights @ np.array(parts)
            widest = max(widest, reach)
        valid = self.valid
        if widest:
            valid = ~widen(~valid, widest)
        return replace(self, tau=tau, valid=valid)

    def away_from(self, excluded: Mask) -> Mask:
        """Return samples beyond the reach of filter and differences from `excluded` ones."""
        return ~widen(excluded, _reach(self.period))


_KEPT: WeakKeyDictionary[Recording, Signals] = WeakKeyDictionary()


def signals(recording: Recording) -> Signals:
    """Put a recording on an even grid and differentiate it, with a cache.

    Parameters
    ----------
    recording : Recording
        Recording with missing samples as NaN or as gaps in time.

    Raises
    ------
    NotEnoughData
        All samples are missing.
    """
    if recording not in _KEPT:
        sampled = recording.fresh
        if not sampled.any():
            raise NotEnoughData("no usable sample; repeat the measurement")
        # sampling period covering most of a motion [s]; if drives update values less often than
        # SYNC, the period is the time between updates
        fresh = recording.time[sampled]
        apart = np.diff(fresh)
        regular = float(np.median(np.diff(recording.time)))
        longer = apart[apart > 1.5 * regular]  # 1.5: at least one sample is missing
        period = float(np.median(longer)) if longer.sum() > apart.sum() / 2 else regular
        index = np.rint((recording.time - recording.time[0]) / period).astype(int)
        n = int(index[-1]) + 1
        time = recording.time[0] + period * np.arange(n)
        missing = np.ones(n, dtype=bool)
        missing[index[sampled]] = False
        q = _interpolate_columns(time, recording.time[sampled], recording.q[sampled])
        tau = _interpolate_columns(time, recording.time[sampled], recording.tau[sampled])
        nearest = np.searchsorted(index, np.arange(n), side="right") - 1
        ends = np.zeros(n, dtype=bool)
        ends[[0, -1]] = True
        spoilt = widen(missing | ends, _reach(period))
        qd, qdd = derivatives(q, period)
        _KEPT[recording] = Signals(
            period=period,
            time=time,
            q=q,
            qd=qd,
            qdd=qdd,
            tau=tau,
            stroke=recording.stroke[nearest],
            partner_stroke=recording.partner_stroke[nearest],
            valid=~spoilt,
            group=None if recording.group is None else recording.group[nearest],
            recorded=recording.q,
        )
    return _KEPT[recording]


def _least_difference(q: Array) -> float:
    """Return the smallest difference of positions above rounding; 0 without a difference."""
    apart = np.diff(np.sort(q))
    # rounding error relative to the largest position: a file has ten decimals
    apart = apart[apart > 1e-9 * np.nanmax(np.abs(q))]
    return float(apart.min(initial=np.inf)) if len(apart) else 0.0


def interpolation(shift: float) -> tuple[int, Array]:
    """Return first sample and six Lagrange weights of a signal `shift` samples later."""
    first = int(np.floor(shift)) - 2
    x, nodes = shift - first, np.arange(6.0)
    apart = nodes[:, np.newaxis] - nodes
    np.fill_diagonal(apart, 1.0)
    factors = np.broadcast_to(x - nodes, apart.shape).copy()
    np.fill_diagonal(factors, 1.0)
    weights: Array = (factors / apart).prod(axis=1)
    return first, weights


def derivatives(x: Array, period: float) -> tuple[Array, Array]:
    """Return first and second derivative along the first axis."""
    return correlate(x, FIRST / period), correlate(x, SECOND / period**2)


@cache
def _forth_and_back(n: int, period: float) -> Array:
    """Return the gain of the Butterworth filter, run forth and back, for `n` samples."""
    frequencies = np.tan(np.pi * fft.rfftfreq(n)) / np.tan(np.pi * CUTOFF * period)
    return np.asarray(1.0 / (1.0 + frequencies ** (2 * ORDER)))


def _reach(period: float) -> int:
    """Return the number of samples noticeably disturbed by filters and differences."""
    return max(half_window(period) + len(SECOND) // 2, round(1.0 / CUTOFF / period))


def _interpolate_columns(time: Array, sampled: Array, values: Array) -> Array:
    columns = [np.interp(time, sampled, column) for column in values.T]
    return np.column_stack(columns)
