"""One recording as a fit takes it: positions, velocities, accelerations and torque, filtered."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from hil.estimation.free_motion.bristles import bent, friction_direction, sign_of_velocity
from hil.estimation.free_motion.filtering import Rates, low_passed, reach

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.free_motion.bristles import Direction
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]


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
    """

    cut_off: float
    band: float
    speed: Array
    recorded_velocity: Mask
    presliding: Array
    lag: Array

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
    smooth : ndarray, shape (n_recorded, n_joints)
        Positions at the recording's own rate, filtered [rad or m].
    """

    processing: Processing
    rates: Rates
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    used: Mask
    smooth: Array

    @property
    def period(self) -> float:
        """Between samples of the motion [s]."""
        return self.rates.period * self.rates.fine

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
    smooth = low_passed(_every_other(recording.q, offset), period, processing.cut_off)[0]
    return Motion(processing, rates, q, qd, qdd, tau, used, smooth)


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
