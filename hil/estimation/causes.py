"""What an estimate would suffer from or does suffer from, cause by cause.

Some causes are taken into account: soft gears, friction of the load, friction that differs by
direction. How much each of them matters is how far the base parameters move where it is ignored.
Torque ripple of orders that the regression does not hold is not: what it does to the parameters is
calculated to first order. And two make the scatter of the parameters larger than noise of the
torque readings does: encoders of few increments, whose second differences are noise, and a SYNC so
slow that little is left to smooth. Theirs is a share of the variance.

Only what is significant counts as a cause. What each means in torques is for
`hil.results.advice` to say.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.drive_train import compliance_units
from hil.estimation.friction.symmetry import of_local_values
from hil.estimation.ripple_orders import unmodelled_ripple
from hil.estimation.simultaneous import SimultaneousFit
from hil.friction.equation import ASYMMETRIC
from hil.least_squares.differences import SECOND
from hil.least_squares.window import HALF_WIDTH, weights
from hil.model.dynamics import mass_matrix
from hil.model.motors import motor_inertia

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.drive_train import DriveTrain
    from hil.estimation.local_values import LocalValue
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion

    Prepared = Sequence[tuple[ParameterMotion, Signals]]

CERTAIN = 5.0
"""Compliance or friction of the load over its standard error from which on it counts."""
ORDINARY = 0.01
"""Difference of friction by direction, as share of it, that any gear may have."""
COARSE = 0.9
"""Share of encoder noise in what the fit leaves of an axis from which on its encoder counts."""
FEWEST_IN_WINDOW = 4.0
"""Samples on either side of the window's middle below which SYNC counts as slow."""
_EVERY = 100
"""Samples from one at which inertias are looked at to the next."""
_ORDER = 8
"""Of differences."""


class CauseName(StrEnum):
    """What may spoil a result; the last two are named where nothing else explains its scatter."""

    SOFT_GEARS = "soft gears"
    LOAD_FRICTION = "friction of the load"
    ASYMMETRY = "friction that differs by direction"
    RIPPLE = "torque ripple of further orders"
    ENCODERS = "coarse encoders"
    SLOW_SYNC = "slow SYNC"
    WEAK_EXCITATION = "weak excitation"
    DISAGREEMENT = "measurements that disagree"


REMEDIES = {
    CauseName.SOFT_GEARS: "nothing: links are placed where the gears let them be; a simulator or a"
    " feed-forward needs the compliances too",
    CauseName.LOAD_FRICTION: "nothing: it is fitted; methods without it find other parameters",
    CauseName.ASYMMETRY: "nothing: it is fitted; it shifts what the published method finds",
    CauseName.RIPPLE: "strokes at higher speeds, whose ripple the window takes away",
    CauseName.ENCODERS: "encoders of more increments, or longer measurements",
    CauseName.SLOW_SYNC: "a shorter SYNC period, in drives file and plan alike, or longer"
    " measurements",
    CauseName.WEAK_EXCITATION: "measurements that move more joints through more of their ranges"
    " (hil plan, hil trajectory plan)",
    CauseName.DISAGREEMENT: "a look at what differs between them: a hand that touches something, a"
    " machine that warms up, a motor that ripples",
}


@dataclass(frozen=True, slots=True, eq=False)
class Cause:
    """One cause of error.

    Attributes
    ----------
    name : CauseName
    axes : tuple of int
        From 0; none where it concerns all.
    detail : str
        What was found, with its figure.
    change : ndarray, shape (n_base,)
        Of the base parameters by the cause; where it is taken into account, what ignoring it would
        do to them. Zero for one that shows as scatter.
    covariance : ndarray, shape (n_base, n_base)
        Part of that of the base parameters which is due to the cause.
    accounted : bool
        Whether the estimate takes it into account.
    """

    name: CauseName
    axes: tuple[int, ...]
    detail: str
    change: Array
    covariance: Array
    accounted: bool = False


def find_causes(
    robot: Robot,
    raw: Prepared,
    drive_train: DriveTrain,
    fit: SimultaneousFit,
    without_load_friction: Array,
    local: Sequence[LocalValue],
    covariance: Array,
) -> tuple[Cause, ...]:
    """Find what matters in an estimate by the improved method.

    Parameters
    ----------
    raw : sequence of (ParameterMotion, Signals)
        As measured.
    drive_train : DriveTrain
        Which was taken into account.
    fit : SimultaneousFit
        Of the measurements with that.
    without_load_friction : ndarray, shape (n_base,)
        Base parameters found before anything was known of it.
    local : sequence of LocalValue
        Each measurement by itself.
    covariance : ndarray, shape (n_base, n_base)
        Of the base parameters, as they scatter.
    """
    return (
        *_soft_gears(robot, raw, drive_train, fit),
        *_load_friction(fit, without_load_friction),
        *_asymmetry(fit, local),
        *_ripple(robot, fit, covariance),
        *_encoders(robot, raw, fit, covariance),
        *_slow_sync(raw, covariance),
    )


def _soft_gears(
    robot: Robot, raw: Prepared, train: DriveTrain, fit: SimultaneousFit
) -> Iterator[Cause]:
    sure = np.nan_to_num(train.compliance / train.compliance_error) > CERTAIN
    if not (train.soft & sure).any():
        return
    rigid = replace(train, soft=np.zeros_like(train.soft))
    ignored = SimultaneousFit(robot, [(m, rigid.applied(robot, s)) for m, s in raw])
    soft = np.flatnonzero(train.soft)
    each = ", ".join(
        f"{1e6 * train.compliance[axis]:.2g} ± {1e6 * train.compliance_error[axis]:.1g}"
        for axis in soft
    )
    detail = f"compliances of {each} {compliance_units(robot)}"
    yield _accounted(CauseName.SOFT_GEARS, soft, detail, ignored.solve() - fit.solve())


def _load_friction(fit: SimultaneousFit, ignored: Array) -> Iterator[Cause]:
    mu, error = fit.load_friction
    axes = np.flatnonzero(np.nan_to_num(mu / error) > CERTAIN)
    if axes.size:
        each = ", ".join(f"{100 * mu[axis]:.2g} ± {100 * error[axis]:.1g}" for axis in axes)
        detail = f"{each} % of the transmitted torque"
        yield _accounted(CauseName.LOAD_FRICTION, axes, detail, ignored - fit.solve())


def _asymmetry(fit: SimultaneousFit, local: Sequence[LocalValue]) -> Iterator[Cause]:
    tests = of_local_values(local, ORDINARY).items()
    failed = {axis: test.asymmetry for axis, test in tests if not test.passed}
    if failed:
        each = ", ".join(f"{100 * asymmetry:.2g}" for asymmetry in failed.values())
        detail = f"{each} % of it, or offsets of the current"
        change = fit.without_terms(ASYMMETRIC) - fit.solve()
        yield _accounted(CauseName.ASYMMETRY, failed, detail, change)


def _accounted(name: CauseName, axes: Iterable[int], detail: str, change: Array) -> Cause:
    n = len(change)
    return Cause(name, tuple(map(int, axes)), detail, change, np.zeros((n, n)), accounted=True)


def _ripple(robot: Robot, fit: SimultaneousFit, covariance: Array) -> Iterator[Cause]:
    found = unmodelled_ripple(robot, fit)
    if found.largest:
        each = ", ".join(
            f"{order} with {a:.2g} {robot.torque_unit(axis)}"
            for axis, (order, a) in found.largest.items()
        )
        part = _part(fit, found.share, covariance)
        axes, detail = tuple(found.largest), f"largest are {each}"
        yield Cause(CauseName.RIPPLE, axes, detail, found.change, part)


def _encoders(
    robot: Robot, raw: Prepared, fit: SimultaneousFit, covariance: Array
) -> Iterator[Cause]:
    share = np.clip(_encoder_noise(robot, raw, fit.solve()) * fit.weight, 0.0, 1.0)
    axes = np.flatnonzero(share > COARSE)
    if axes.size:
        found, detail = tuple(axes.tolist()), "accelerations are noisier than what the fit leaves"
        part = _part(fit, share, covariance)
        yield Cause(CauseName.ENCODERS, found, detail, np.zeros(fit.n_base), part)


def _part(fit: SimultaneousFit, share: Array, covariance: Array) -> Array:
    """Part of `covariance` that is due to a share of each axis's residual variance."""
    G = fit.noise_covariance[: fit.n_base]
    white = np.diag(G)
    scale = np.sqrt(np.diag(covariance) / np.where(white > 0, white, np.inf))
    part: Array = (G @ fit.information_of(share) @ G.T) * np.outer(scale, scale)
    return part


def _encoder_noise(robot: Robot, raw: Prepared, p: Array) -> Array:
    """Variance of each axis's smoothed torque that noise of accelerations would need [(N m)^2].

    It is what eighth differences of positions show in steady motion, which leave nothing of motion.
    """
    variance, count = np.zeros(robot.n_joints), np.zeros(robot.n_joints)
    looked_at = [s.q[::_EVERY] for _, s in raw]
    inertias = mass_matrix(robot, p, np.concatenate(looked_at))
    inertias += motor_inertia(robot, looked_at[0][0])
    parts = np.split(inertias, np.cumsum(list(map(len, looked_at)))[:-1])
    for (m, s), inertia in zip(raw, parts, strict=True):
        gain = np.sum(np.convolve(SECOND, weights(s.period)) ** 2) / s.period**4
        differences = np.diff(s.q, _ORDER, axis=0)
        noise = np.zeros(robot.n_joints)
        for joint in m.moved:
            steady = s.usable(robot, joint)[_ORDER // 2 : -_ORDER // 2]
            if steady.any():
                noise[joint] = (
                    np.mean(differences[steady, joint] ** 2) * gain / comb(2 * _ORDER, _ORDER)
                )
        for axis in m.moved:
            variance[axis] += (inertia[:, axis] ** 2 @ noise).sum()
            count[axis] += len(inertia)
    return variance / np.maximum(count, 1.0)


def _slow_sync(raw: Prepared, covariance: Array) -> Iterator[Cause]:
    period = max(s.period for _, s in raw)
    enough = HALF_WIDTH / FEWEST_IN_WINDOW
    if period > enough * (1 + 1e-9):
        detail = f"{1e3 * period:g} ms where {1e3 * enough:g} ms would do"
        none, part = np.zeros(len(covariance)), (1.0 - enough / period) * covariance
        yield Cause(CauseName.SLOW_SYNC, (), detail, none, part)
