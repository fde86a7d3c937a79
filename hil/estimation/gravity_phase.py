"""Show a missing centre of mass as a phase shift of a gravity torque (the paper's Fig. 7).

Gravity is linear in the sine and cosine of each joint angle, so the gravity torque of one axis over
the angle of another is a sinusoid, determined by its values at three angles. A parameter missing in
the robot file shifts the sinusoid. Every pair of axes is examined at the measured configuration
with the largest stated sinusoid, and the pair with the largest shift is shown; among similar shifts
the one with the weakest motor, whose friction hides least.

A measurement at another configuration is transferred to the shown one: its value is the extended
model there, plus its own residual of the extended model, less the mean residual of all
measurements, which is direction-dependent friction.
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
"""Smallest relevant shift [rad]; below, a missing parameter acts by its inertia only."""


@dataclass(frozen=True, slots=True)
class Sinusoid:
    """Sinusoid mean + cosine cos(angle) + sine sin(angle) [N m]."""

    mean: float
    cosine: float
    sine: float

    def evaluate(self, angle: Array) -> Array:
        """Return the torque at angles [rad]."""
        return self.mean + self.cosine * np.cos(angle) + self.sine * np.sin(angle)

    @property
    def amplitude(self) -> float:
        """Amplitude [N m]."""
        return float(np.hypot(self.cosine, self.sine))

    def phase_against(self, other: Sinusoid) -> float:
        """Return the phase lead over another sinusoid [rad], within +- pi."""
        own, others = (complex(s.cosine, -s.sine) for s in (self, other))
        return float(np.angle(own / others)) if others else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """Gravity torque over a joint angle: stated, extended and measured.

    Attributes
    ----------
    axis, over : int
        Axis of the torque, axis of the varied angle; from 0.
    q : ndarray, shape (n_joints,)
        Configuration; the angle of `over` is varied [rad].
    stated, extended : Sinusoid
        Sinusoid of the robot file, and sinusoid with the missing parameters.
    angle, torque : ndarray, shape (n,)
        Measurements of the axis, transferred to configuration `q` [rad], [N m].
    standard_error : ndarray, shape (n,)
        Standard errors by the scatter within each measurement; NaN if unknown [N m].
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
    """Find the pair of axes with the largest phase shift; None without a gravity effect."""
    local = [value for value in best.local if value.symbol == "g"]
    largest = [
        # the measurement with the largest stated sinusoid over the angle, and both sinusoids
        max(
            ((v, over, *_sinusoids(errors, v.q, v.axis, over)) for v in local if v.axis == axis),
            key=lambda each: each[2].amplitude,
        )
        for axis in {value.axis for value in local}
        for over in range(errors.complete.n_joints)
        if over != axis
    ]
    # smallest usable amplitude for a phase [N m]
    clear = [each for each in largest if each[2].amplitude > 0.5] or largest
    shifts = [abs(extended.phase_against(stated)) for *_, stated, extended in clear]
    if max(shifts, default=0.0) < SEEN:
        return None
    # smallest share of the largest shift among similar shifts
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


def _sinusoids(errors: ModelErrors, q: Array, axis: int, over: int) -> tuple[Sinusoid, Sinusoid]:
    """Return stated and extended torque of an axis over a single angle at `q`."""
    turned = np.tile(q, (3, 1))
    turned[:, over] = [0.0, np.pi / 2, np.pi]
    found = []
    for p in models(errors):
        zero, quarter, half = _torque(errors, turned, axis, p)
        mean = (zero + half) / 2
        found.append(Sinusoid(float(mean), float((zero - half) / 2), float(quarter - mean)))
    return found[0], found[1]


def _brought(errors: ModelErrors, values: list[LocalValue], q: Array, over: int) -> Array:
    """Return measured torques transferred to `q`: extended model plus centred residuals."""
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
    """Return base parameters of the complete robot: as stated, and with missing parameters."""
    return errors.stated @ errors.p, errors.p_all


def _torque(errors: ModelErrors, q: Array, axis: int, p: Array) -> Array:
    return gravity_torque(errors.complete, p, q)[:, axis]
