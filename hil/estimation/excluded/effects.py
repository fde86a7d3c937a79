"""Effects of untested causes on an estimate: fitted causes, and sources of scatter.

Fitted causes are soft gears, friction of the load, and friction that differs by direction. Their
effect is the change of the base parameters if the cause is ignored. Torque ripple of orders outside
the regression changes the parameters to first order. Two causes make parameters scatter more than
by noise of the torque readings: encoders of few increments, with noisy second differences, and a
SYNC period too long for smoothing. Only significant effects count; `hil.results.advice` states the
effects in torques.
"""

from __future__ import annotations

from dataclasses import replace
from math import comb
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.drive_train import CERTAIN, compliance_units
from hil.estimation.excluded.causes import uncertain
from hil.estimation.friction.points import judge_local_values
from hil.estimation.ripple_orders import unmodelled_ripple
from hil.estimation.simultaneous import SimultaneousFit
from hil.least_squares.window import LONGEST, SECOND, weights
from hil.model.dynamics import mass_matrix
from hil.model.motors import motor_inertia

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.local_fits import LocalValue
    from hil.estimation.simultaneous import Joint
    from hil.model.robot import Robot

ORDINARY = 0.01
"""Usual difference of a gear's friction between the directions, as a share of friction."""
COARSE = 0.9
"""Minimum share of encoder noise in an axis's residual, for a coarse encoder. On the virtual plant
without any error the share is at most 0.58 (clean runs 1000, 1005 and 1011 of
`benchmarks/excluded.py`), with 1024 increments a turn above 0.9 (docs, causes-of-error.md)."""
_EVERY = 100
"""Samples between two evaluations of inertia."""
_ORDER = 8
"""Order of the differences."""


class Effect(NamedTuple):
    """Effect of a cause on an estimate.

    Attributes
    ----------
    cause : str
        One of `hil.estimation.excluded.causes.CAUSES`.
    axes : tuple of int
        Axes from 0; none if the cause concerns all.
    detail : str
        Finding, with its figure.
    change : ndarray, shape (n_base,)
        Change of the base parameters; for a fitted cause, the change if it were ignored.
    covariance : ndarray, shape (n_base, n_base)
        Part of the base parameters' covariance due to the cause.
    """

    cause: str
    axes: tuple[int, ...]
    detail: str
    change: Array
    covariance: Array


def effects(
    robot: Robot, joint: Joint, local: Sequence[LocalValue], covariance: Array
) -> Iterator[Effect]:
    """Yield causes with an effect on an estimate by the improved method, ignored or fitted.

    Parameters
    ----------
    local : sequence of LocalValue
        Values from single measurements.
    covariance : ndarray, shape (n_base, n_base)
        Covariance of the base parameters by their scatter.
    """
    fit, none = joint.solver, np.zeros_like(covariance)
    for cause, axes, detail, ignored in _fitted(robot, joint, local):
        yield Effect(cause, tuple(map(int, axes)), detail, ignored - fit.solve(), none)
    still = np.zeros(fit.n_base)
    ripple = unmodelled_ripple(robot, fit)
    if ripple.largest:
        each = ", ".join(
            f"order {order} with {a:.2g} {robot.torque_unit(axis)}"
            for axis, (order, a) in ripple.largest.items()
        )
        part = _part(fit, ripple.share, covariance)
        detail = f"largest amplitudes: {each}"
        yield Effect("torque ripple of further orders", tuple(ripple.largest), detail,
                     ripple.change, part)  # fmt: skip
    share = np.clip(_encoder_noise(robot, joint) * fit.weight, 0.0, 1.0)
    if coarse := tuple(np.flatnonzero(share > COARSE).tolist()):
        detail = "accelerations are noisier than the residual"
        part = _part(fit, share, covariance)
        yield Effect("coarse encoders", coarse, detail, still, part)
    period = max(s.period for _, s in joint.prepared)
    if period > LONGEST:
        detail = f"{1e3 * period:g} ms; {1e3 * LONGEST:g} ms is sufficient"
        part = (1.0 - LONGEST / period) * covariance
        yield Effect("slow SYNC", (), detail, still, part)


def _fitted(
    robot: Robot, joint: Joint, local: Sequence[LocalValue]
) -> Iterator[tuple[str, Iterable[int], str, Array]]:
    """Yield fitted causes: name, axes, detail, and base parameters without the cause."""
    fit, train = joint.solver, joint.drive_train
    sure = np.nan_to_num(train.compliance / train.compliance_error) > CERTAIN
    if (train.soft & sure).any():
        soft = np.flatnonzero(train.soft)
        rigid = SimultaneousFit(robot, [(m, replace(s, twist=None)) for m, s in joint.prepared])
        each = _format_errors(1e6, train.compliance, train.compliance_error, soft)
        detail = f"compliances of {each} {compliance_units(robot)}"
        yield "soft gears", soft, detail, rigid.solve()
    mu, error = fit.load_friction
    if (loaded := np.flatnonzero(np.nan_to_num(mu / error) > CERTAIN)).size:
        detail = f"{_format_errors(100, mu, error, loaded)} % of the transmitted torque"
        yield "friction of the load", loaded, detail, joint.rigid
    tests = judge_local_values(local, ORDINARY).items()
    if failed := {axis: test.asymmetry for axis, test in tests if not test.passed}:
        each = ", ".join(f"{100 * asymmetry:.2g}" for asymmetry in failed.values())
        detail = f"{each} % of friction, or offsets of the current sensors"
        yield "friction that differs by direction", failed, detail, fit.solve_without_asymmetry()


def _format_errors(factor: float, value: Array, error: Array, axes: Indices) -> str:
    return ", ".join(uncertain(factor * float(value[k]), factor * float(error[k])) for k in axes)


def _part(fit: SimultaneousFit, share: Array, covariance: Array) -> Array:
    """Return the part of `covariance` due to a share of the axes' residual variance."""
    G = fit.noise_covariance[: fit.n_base]
    white = np.diag(G)
    scale = np.sqrt(np.diag(covariance) / np.where(white > 0, white, np.inf))
    part: Array = (G @ fit.information_of(share) @ G.T) * np.outer(scale, scale)
    return part


def _encoder_noise(robot: Robot, joint: Joint) -> Array:
    """Estimate the variance of smoothed torque due to encoder noise, by axis [(N m)^2].

    Noise shows in eighth differences of positions in steady motion, which remove the motion.
    """
    variance, count = np.zeros(robot.n_joints), np.zeros(robot.n_joints)
    looked_at = [s.q[::_EVERY] for _, s in joint.prepared]
    inertias = mass_matrix(robot, joint.solver.solve(), np.concatenate(looked_at))
    inertias += motor_inertia(robot, looked_at[0][0])
    parts = np.split(inertias, np.cumsum(list(map(len, looked_at)))[:-1])
    for (m, s), inertia in zip(joint.prepared, parts, strict=True):
        gain = np.sum(np.convolve(SECOND, weights(s.period)) ** 2) / s.period**4
        differences = np.diff(s.q, _ORDER, axis=0)
        noise = np.zeros(robot.n_joints)
        for axis in m.moved:
            steady = s.usable(robot, axis)[_ORDER // 2 : -_ORDER // 2]
            if steady.any():
                square = np.mean(differences[steady, axis] ** 2)
                noise[axis] = square * gain / comb(2 * _ORDER, _ORDER)
        for axis in m.moved:
            variance[axis] += (inertia[:, axis] ** 2 @ noise).sum()
            count[axis] += len(inertia)
    return variance / np.maximum(count, 1.0)
