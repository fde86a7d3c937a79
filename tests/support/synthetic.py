"""Recordings with known parameters, made without a plant, for tests of the estimators.

Strokes are trapezoids whose ramps are smooth polynomials, so that positions, velocities and
accelerations are known in closed form and sampling loses nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.planning.strokes import REST
from hil.runs.recording import IDLE, Recording

PERIOD = 0.004
TABLE_3_A = np.array(
    [32.015, -28.058, -2.187, 19.905, 48.491, 9.602, 13.313,
     -15.836, 0.0, 0.0443, 0.2883, 0.1554, -0.1885, 0.3760]
)  # fmt: skip


@dataclass
class Friction:
    """Coulomb, viscous and cube-root friction of every axis, with its growth over a campaign."""

    coulomb: float = 40.0
    viscous: float = 10.0
    root: float = 8.0
    growth: float = 0.0
    """Relative growth [1/s]."""
    offset: np.ndarray = field(default_factory=lambda: np.zeros(6))

    def torque(self, qd, time):
        level = self.coulomb * np.sign(qd) + self.viscous * qd + self.root * np.cbrt(qd)
        return level * (1 + self.growth * time[:, np.newaxis]) + self.offset


def record(robot, measurement, p, friction, *, begin=0.0, noise=0.0, rng=None):
    """Return the recording of an ideal machine for `measurement`, with start time `begin`."""
    profile = measurement.profile(0)
    ramp = max(profile.ramp_time, 0.12)
    lead = int(REST / PERIOD)
    stroke_time = measurement.stroke / profile.peak + ramp
    n = int(2 * REST / PERIOD + measurement.n_strokes * (stroke_time + 0.1) / PERIOD)
    t = np.arange(n) * PERIOD
    q = np.tile(measurement.start, (n, 1))
    qd, qdd = np.zeros((n, robot.n_joints)), np.zeros((n, robot.n_joints))
    stroke, partner_stroke = np.full(n, IDLE, np.int16), np.full(n, IDLE, np.int16)
    for k in range(measurement.n_strokes):
        start = lead * PERIOD + k * (stroke_time + 0.1)
        sign = 1 if k % 2 == 0 else -1
        _add(q, qd, qdd, measurement.index, t - start, sign * profile.peak,
             stroke_time, ramp)  # fmt: skip
        stroke[(t >= start) & (t < start + stroke_time + 0.1)] = k
        if measurement.partners:
            _partner(measurement, t, start, stroke_time, ramp, (q, qd, qdd), partner_stroke)
    stroke[t >= t[-1] - REST] = IDLE
    tau = inverse_dynamics(robot, p, q, qd, qdd) + motor_torque(robot, q, qd, qdd)
    tau = tau + friction.torque(qd, begin + t)
    if noise:
        tau = tau + noise * robot.torque_limit * rng.standard_normal(tau.shape)
    flags = np.zeros(q.shape, np.uint8)
    return Recording(begin + t, q, tau, flags, stroke, partner_stroke)


def _partner(m, t, start, stroke_time, ramp, motion, partner_stroke):
    each = m.partner.stroke / m.partner.velocity + 0.2
    begin, number = start + ramp + 0.2, 0
    while begin + 2 * (each + 0.1) < start + stroke_time - ramp:
        for sign in (1, -1):
            _add(*motion, m.partner.index, t - begin, sign * m.partner.velocity, each, 0.2)
            partner_stroke[(t >= begin) & (t < begin + each + 0.1)] = number
            begin, number = begin + each + 0.1, number + 1


def _add(q, qd, qdd, axis, t, velocity, duration, ramp):
    """Add one stroke of `axis`: smooth ramp, constant velocity, smooth ramp."""

    def way(u):  # products, because powers of arrays take ten times as long
        return u * u * u * u * (u * u - 3 * u + 2.5)

    up, down = np.clip(t / ramp, 0, 1), np.clip((t - duration + ramp) / ramp, 0, 1)
    cruise = np.clip(t - ramp, 0, duration - 2 * ramp)
    q[:, axis] += velocity * (ramp * way(up) + cruise + ramp * (down - way(down)))
    step = [u * u * u * (6 * u * u - 15 * u + 10) for u in (up, down)]
    slope = [30 * u * u * (u * u - 2 * u + 1) for u in (up, down)]
    qd[:, axis] += velocity * (step[0] - step[1])
    qdd[:, axis] += velocity / ramp * (slope[0] - slope[1])
