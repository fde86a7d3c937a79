"""What causes beside the tests do to an estimate: it fits some of them, others are its scatter.

How much one that is fitted matters is how far the base parameters move where it is ignored: soft
gears, friction of the load, friction that differs by direction. Torque ripple of orders that the
regression does not hold moves them to first order. Two make parameters scatter more than noise of
the torque readings does: encoders of few increments, whose second differences are noise, and a SYNC
so slow that little is left to smooth. Only what is significant counts; what it means in torques is
for `hil.results.advice` to say.
"""

from __future__ import annotations

from dataclasses import replace
from math import comb
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.drive_train import CERTAIN, compliance_units
from hil.estimation.friction.symmetry import of_local_values
from hil.estimation.ripple_orders import unmodelled_ripple
from hil.estimation.simultaneous import SimultaneousFit
from hil.least_squares.differences import SECOND
from hil.least_squares.window import HALF_WIDTH, weights
from hil.model.dynamics import mass_matrix
from hil.model.motors import motor_inertia

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.local_values import LocalValue
    from hil.estimation.simultaneous import Joint
    from hil.model.robot import Robot

ORDINARY = 0.01
"""Difference of friction by direction, as share of it, that any gear may have."""
COARSE = 0.9
"""Share of encoder noise in what the fit leaves of an axis from which on its encoder counts: of the
virtual plant with nothing wrong it is 0.58 at most (clean runs 1000, 1005 and 1011 of
`benchmarks/excluded.py`), with 1024 increments a turn more than this (docs, causes-of-error.md)."""
FEWEST_IN_WINDOW = 4.0
"""Samples on either side of the window's middle below which SYNC counts as slow."""
_EVERY = 100
"""Samples from one at which inertias are looked at to the next."""
_ORDER = 8
"""Of differences."""


class Effect(NamedTuple):
    """What a cause does to an estimate.

    Attributes
    ----------
    cause : str
        One of `hil.estimation.excluded.causes.CAUSES`.
    axes : tuple of int
        From 0; none where it concerns all.
    detail : str
        What was found, with its figure.
    change : ndarray, shape (n_base,)
        Of the base parameters; of a cause that is fitted what ignoring it would do to them.
    covariance : ndarray, shape (n_base, n_base)
        Part of that of the base parameters which is due to the cause.
    """

    cause: str
    axes: tuple[int, ...]
    detail: str
    change: Array
    covariance: Array


def effects(
    robot: Robot, joint: Joint, local: Sequence[LocalValue], covariance: Array
) -> Iterator[Effect]:
    """What matters to an estimate by the improved method, or would if it were ignored.

    Parameters
    ----------
    local : sequence of LocalValue
        Each measurement by itself.
    covariance : ndarray, shape (n_base, n_base)
        Of the base parameters, as they scatter.
    """
    fit, none = joint.solver, np.zeros_like(covariance)
    for cause, axes, detail, ignored in _fitted(robot, joint, local):
        yield Effect(cause, tuple(map(int, axes)), detail, ignored - fit.solve(), none)
    still = np.zeros(fit.n_base)
    ripple = unmodelled_ripple(robot, fit)
    if ripple.largest:
        each = ", ".join(
            f"{order} with {a:.2g} {robot.torque_unit(axis)}"
            for axis, (order, a) in ripple.largest.items()
        )
        part = _part(fit, ripple.share, covariance)
        detail = f"largest are {each}"
        yield Effect("torque ripple of further orders", tuple(ripple.largest), detail,
                     ripple.change, part)  # fmt: skip
    share = np.clip(_encoder_noise(robot, joint) * fit.weight, 0.0, 1.0)
    if coarse := tuple(np.flatnonzero(share > COARSE).tolist()):
        detail = "accelerations are noisier than what the fit leaves"
        part = _part(fit, share, covariance)
        yield Effect("coarse encoders", coarse, detail, still, part)
    period, enough = max(s.period for _, s in joint.prepared), HALF_WIDTH / FEWEST_IN_WINDOW
    if period > enough * (1 + 1e-9):
        detail = f"{1e3 * period:g} ms where {1e3 * enough:g} ms would do"
        part = (1.0 - enough / period) * covariance
        yield Effect("slow SYNC", (), detail, still, part)


def _fitted(
    robot: Robot, joint: Joint, local: Sequence[LocalValue]
) -> Iterator[tuple[str, Iterable[int], str, Array]]:
    """Causes that are taken into account: axes, detail, and base parameters without that."""
    fit, train = joint.solver, joint.drive_train
    sure = np.nan_to_num(train.compliance / train.compliance_error) > CERTAIN
    if (train.soft & sure).any():
        soft = np.flatnonzero(train.soft)
        rigid = SimultaneousFit(robot, [(m, replace(s, twist=None)) for m, s in joint.prepared])
        each = _with_errors(1e6, train.compliance, train.compliance_error, soft)
        detail = f"compliances of {each} {compliance_units(robot)}"
        yield "soft gears", soft, detail, rigid.solve()
    mu, error = fit.load_friction
    if (loaded := np.flatnonzero(np.nan_to_num(mu / error) > CERTAIN)).size:
        detail = f"{_with_errors(100, mu, error, loaded)} % of the transmitted torque"
        yield "friction of the load", loaded, detail, joint.rigid
    tests = of_local_values(local, ORDINARY).items()
    if failed := {axis: test.asymmetry for axis, test in tests if not test.passed}:
        each = ", ".join(f"{100 * asymmetry:.2g}" for asymmetry in failed.values())
        detail = f"{each} % of it, or offsets of the current"
        yield "friction that differs by direction", failed, detail, fit.solve_without_asymmetry()


def _with_errors(factor: float, value: Array, error: Array, axes: Indices) -> str:
    return ", ".join(f"{factor * value[k]:.2g} ± {factor * error[k]:.1g}" for k in axes)


def _part(fit: SimultaneousFit, share: Array, covariance: Array) -> Array:
    """Part of `covariance` that is due to a share of each axis's residual variance."""
    G = fit.noise_covariance[: fit.n_base]
    white = np.diag(G)
    scale = np.sqrt(np.diag(covariance) / np.where(white > 0, white, np.inf))
    part: Array = (G @ fit.information_of(share) @ G.T) * np.outer(scale, scale)
    return part


def _encoder_noise(robot: Robot, joint: Joint) -> Array:
    """Variance of each axis's smoothed torque that noise of accelerations would need [(N m)^2].

    It is what eighth differences of positions show in steady motion, which leave nothing of motion.
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
