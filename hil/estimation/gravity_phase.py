"""The paper's Fig. 7: what a left-out centre of mass does to the phase of a gravity torque.

Gravity is linear in the sine and cosine of each joint angle, so the gravity torque of one axis over
the angle of another is a sinusoid, determined by its values at three angles. What the robot file
leaves out shifts it. Every pair of axes is looked at where, of the measured configurations, its
stated sinusoid is largest, and the one that is shifted most is shown; of several alike the one with
the weakest motor, whose friction hides least.

A measurement at another configuration is brought to the one shown: it is drawn as the extended
model there, plus what the extended model leaves of it where it was taken, less what it leaves of
all of them alike, which is friction that differs by direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.model.dynamics import gravity_torque

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.absent_parameters import ModelErrors
    from hil.estimation.estimate import Estimate
    from hil.estimation.local_values import LocalValue


SEEN = 0.005
"""Shift below which what was found acts by its inertia only [rad]."""


@dataclass(frozen=True, slots=True)
class Sinusoid:
    """mean + cosine cos(angle) + sine sin(angle) [N m]."""

    mean: float
    cosine: float
    sine: float

    def at(self, angle: Array) -> Array:
        """Torque at angles [rad]."""
        return self.mean + self.cosine * np.cos(angle) + self.sine * np.sin(angle)

    @property
    def amplitude(self) -> float:
        """[N m]."""
        return float(np.hypot(self.cosine, self.sine))

    def phase_against(self, other: Sinusoid) -> float:
        """Angle by which this one lies to the left of another [rad], within +- pi."""
        own, others = (complex(s.cosine, -s.sine) for s in (self, other))
        return float(np.angle(own / others)) if others else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """A gravity torque over a joint angle: as stated, with what was found, as measured.

    Attributes
    ----------
    axis, over : int
        Axis whose torque it is, axis whose angle it is drawn over; from 0.
    q : ndarray, shape (n_joints,)
        Configuration; that of `over` is varied [rad].
    stated, extended : Sinusoid
        By the robot file; with what was found taken in.
    angle, torque : ndarray, shape (n,)
        Measurements of the axis, brought to this configuration [rad], [N m].
    standard_error : ndarray, shape (n,)
        Theirs, by their own scatter; NaN where it is unknown [N m].
    """

    axis: int
    over: int
    q: Array
    stated: Sinusoid
    extended: Sinusoid
    angle: Array
    torque: Array
    standard_error: Array

    @property
    def shift(self) -> float:
        """Phase of the extended sinusoid less that of the stated one [rad]."""
        return self.extended.phase_against(self.stated)


def shifted_most(best: Estimate, errors: ModelErrors, torque_limit: Array) -> Phase | None:
    """Find the pair of axes whose sinusoid is shifted most; None where gravity is not concerned."""
    local = [value for value in best.local if value.symbol == "g"]
    largest = [
        _largest(errors, [v for v in local if v.axis == axis], over)
        for axis in {value.axis for value in local}
        for over in range(errors.complete.n_joints)
        if over != axis
    ]
    # amplitude below which a sinusoid is no place to read a phase [N m]
    clear = [each for each in largest if each[2].amplitude > 0.5] or largest
    shifts = [abs(extended.phase_against(stated)) for *_, stated, extended in clear]
    if max(shifts, default=0.0) < SEEN:
        return None
    # share of the largest shift from which on shifts count as alike
    alike = [each for each, s in zip(clear, shifts, strict=True) if s >= 0.8 * max(shifts)]
    value, over, stated, extended = min(alike, key=lambda each: torque_limit[each[0].axis])
    own = [v for v in local if v.axis == value.axis]
    return Phase(
        axis=value.axis,
        over=over,
        q=value.q.copy(),
        stated=stated,
        extended=extended,
        angle=np.array([v.q[over] for v in own]),
        torque=_brought(errors, own, value.q, over),
        standard_error=np.array([v.standard_error for v in own]),
    )


def _largest(
    errors: ModelErrors, values: list[LocalValue], over: int
) -> tuple[LocalValue, int, Sinusoid, Sinusoid]:
    """The measurement where the stated sinusoid over one angle is largest, and both sinusoids."""
    shown = [(value, over, *_sinusoids(errors, value.q, value.axis, over)) for value in values]
    return max(shown, key=lambda each: each[2].amplitude)


def _sinusoids(errors: ModelErrors, q: Array, axis: int, over: int) -> tuple[Sinusoid, Sinusoid]:
    """Stated and extended torque of an axis over one angle, the others as in `q`."""
    turned = np.tile(q, (3, 1))
    turned[:, over] = [0.0, np.pi / 2, np.pi]
    found = []
    for p in models(errors):
        zero, quarter, half = _torque(errors, turned, axis, p)
        mean = (zero + half) / 2
        found.append(Sinusoid(float(mean), float((zero - half) / 2), float(quarter - mean)))
    return found[0], found[1]


def _brought(errors: ModelErrors, values: list[LocalValue], q: Array, over: int) -> Array:
    """Extended model at `q` with each measurement's own angle, plus residuals less their mean."""
    stated, extended = models(errors)
    axis = values[0].axis
    there = np.array([value.q for value in values])
    here = np.tile(q, (len(values), 1))
    here[:, over] = there[:, over]
    left = np.array([value.value - value.model for value in values])
    left = left - _torque(errors, there, axis, extended - stated)
    torque: Array = _torque(errors, here, axis, extended) + left - left.mean()
    return torque


def models(errors: ModelErrors) -> tuple[Array, Array]:
    """Base parameters of the complete robot: as the file states it, and with what was found."""
    return errors.stated @ errors.p, errors.p_all


def _torque(errors: ModelErrors, q: Array, axis: int, p: Array) -> Array:
    return gravity_torque(errors.complete, p, q)[:, axis]
