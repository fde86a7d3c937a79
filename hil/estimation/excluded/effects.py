"""Effects of untested causes on an estimate: fitted causes, and sources of scatter.

The effect of a fitted cause is the change of the base parameters if it is ignored: soft gears,
friction of the load, friction that differs by direction. Torque ripple of orders outside the
regression changes the parameters to first order. Two causes make parameters scatter more than noise
of the torque readings does: encoders of few increments, with noisy second differences, and a SYNC
period too long for smoothing. Only significant effects count; `hil.results.advice` states their
meaning in torques.

Detect torque ripple of orders outside the regression.

The regression contains the first six multiples of the motor angle theta. Further orders n are
searched for in the residuals of each axis: cos n theta and sin n theta, smoothed like all signals
and with friction of each measurement projected out, are fitted to the residuals measurement by
measurement. The phase differs between measurements: the servo compensates a part of the ripple,
depending on the speed. Most orders explain no more than any two columns explain of noise, so the
median is the noise level; the order with the largest explained part counts if noise is an unlikely
cause (chi-square with two degrees of freedom a measurement), corrected for the number of tested
orders and axes (Bonferroni). Then the next order is searched for in the remainder.

Fast motion hides ripple, because the window filters it out. The remaining ripple is a share of the
residual variance, and to first order changes the base parameters by

    N^-1 sum over samples of w X' r,

with N the information and r the ripple.
"""

from __future__ import annotations

from dataclasses import replace
from math import comb
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.drive_train import CERTAIN, compliance_units
from hil.estimation.friction.symmetry import judge_local_values
from hil.estimation.simultaneous import SimultaneousFit
from hil.friction.equation import place
from hil.friction.ripple import RIPPLE_ORDERS, multiples
from hil.least_squares.normal_equations import smooth_at
from hil.least_squares.solving import orthonormal, project_out
from hil.least_squares.window import HALF_WIDTH, SECOND, half_window, weights
from hil.model.added_parameters import motor_inertia
from hil.model.dynamics import mass_matrix

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array, Indices
    from hil.estimation.condensed import Stacked
    from hil.estimation.local_values import LocalValue
    from hil.estimation.signals import Signals
    from hil.estimation.simultaneous import Joint
    from hil.model.robot import Robot

ORDERS = range(RIPPLE_ORDERS[-1] + 1, 25)
"""Tested orders; the window suppresses higher orders except on creeping axes."""


class UnmodelledRipple(NamedTuple):
    """Detected ripple outside the regression.

    Attributes
    ----------
    largest : dict
        Order and amplitude at the joint [N m] of the strongest ripple, by index of the axis.
    share : ndarray, shape (n_joints,)
        Share of each axis's residual variance.
    change : ndarray, shape (n_base,)
        Change of the base parameters.
    """

    largest: dict[int, tuple[int, float]]
    share: Array
    change: Array


def unmodelled_ripple(robot: Robot, fit: SimultaneousFit) -> UnmodelledRipple:
    """Detect ripple of further orders in the measurements of a fit."""
    side, share = np.zeros(len(fit.information)), np.zeros(robot.n_joints)
    solution, largest = fit.solution, {}
    for axis in range(robot.n_joints):
        own = [(s, each) for s, stacked in fit.stacked for each in stacked if each.axis == axis]
        if not own:
            continue
        pieces = [_piece(robot, s, each, solution) for s, each in own]
        # probability of a single false order among all axes
        orders, ripple = _found(pieces, 1e-3 / (robot.n_joints * len(ORDERS)))
        if not orders:
            continue
        largest[axis] = next(iter(orders.items()))
        used = sum(len(r) for r in ripple)
        share[axis] = min(1.0, fit.weight[axis] * sum(r @ r for r in ripple) / used)
        side[place(robot, axis)] += fit.weight[axis] * sum(
            each.each * each.X.T @ r for (_, each), r in zip(own, ripple, strict=True)
        )
    return UnmodelledRipple(largest, share, (fit.noise_covariance @ side)[: fit.n_base])


class _Piece(NamedTuple):
    """Measurement of an axis, friction projected out.

    Attributes
    ----------
    columns : ndarray, shape (n, n_orders)
        Cosines, with sines as imaginary parts.
    residual : ndarray, shape (n,)
        Residual torque [N m].
    """

    columns: NDArray[np.complex128]
    residual: Array

    def explained(self, residual: Array) -> tuple[Array, Array]:
        """Return explained squares of a residual by order, and squares of a unit amplitude."""
        c, s = self.columns.real, self.columns.imag
        cc, ss, cs = (np.einsum("nk,nk->k", *pair) for pair in ((c, c), (s, s), (c, s)))
        on_c, on_s = residual @ c, residual @ s
        apart = cc * ss - cs**2
        square = ss * on_c**2 - 2 * cs * on_c * on_s + cc * on_s**2
        # smallest independent share of a cosine and a sine
        clear = apart > 1e-6 * cc * ss
        return np.divide(square, apart, out=np.zeros_like(cc), where=clear), (cc + ss) / 2

    def ripple(self, orders: list[int]) -> Array:
        """Return the joint ripple of the orders with given indices, shape (n,)."""
        own = self.columns[:, orders]
        Q, _ = orthonormal(np.hstack([own.real, own.imag]))
        return np.asarray(Q @ (Q.T @ self.residual))


def _piece(robot: Robot, s: Signals, each: Stacked, solution: Array) -> _Piece:
    reach = half_window(s.period)
    own = slice(each.index[0] - reach, each.index[-1] + reach + 1)
    angle = robot.gear_ratio[each.axis] * s.q[own, each.axis]
    columns = smooth_at(each.index - own.start, multiples(angle, ORDERS).T, s.period)
    residual = each.torques[:, 0] - each.X @ solution[place(robot, each.axis)]
    free, _ = orthonormal(each.friction)
    return _Piece(project_out(free, columns), project_out(free, residual))


def _found(pieces: list[_Piece], chance: float) -> tuple[dict[int, float], list[Array]]:
    """Return orders with amplitudes [N m], and the ripple in every piece [N m]."""
    bound = special.chdtri(2 * len(pieces), chance) / special.chdtri(2 * len(pieces), 0.5)
    orders: dict[int, float] = {}
    places: list[int] = []
    ripple = [np.zeros_like(piece.residual) for piece in pieces]
    while len(places) < len(ORDERS) // 2:
        left = zip(pieces, ripple, strict=True)
        each = [piece.explained(piece.residual - known) for piece, known in left]
        explained, size = np.sum(each, axis=0)
        level, best = float(np.median(explained)), int(np.argmax(explained))
        if not explained[best] > bound * level:
            break
        places.append(best)
        orders[ORDERS[best]] = float(np.sqrt((explained[best] - level) / size[best]))
        ripple = [piece.ripple(places) for piece in pieces]
    return orders, ripple


ORDINARY = 0.01
"""Usual difference of a gear's friction between the directions, as a share of friction."""
COARSE = 0.9
"""Minimum share of encoder noise in an axis's residual, for a coarse encoder: on the virtual plant
with nothing wrong it is 0.58 at most (clean runs 1000, 1005 and 1011 of `benchmarks/excluded.py`),
with 1024 increments a turn more than this (docs, causes-of-error.md)."""
FEWEST_IN_WINDOW = 4.0
"""Minimum number of samples on either side of the window's middle; fewer mean a slow SYNC."""
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
            f"{order} with {a:.2g} {robot.torque_unit(axis)}"
            for axis, (order, a) in ripple.largest.items()
        )
        part = _part(fit, ripple.share, covariance)
        detail = f"largest are {each}"
        yield Effect("torque ripple of further orders", tuple(ripple.largest), detail,
                     ripple.change, part)  # fmt: skip
    share = np.clip(_encoder_noise(robot, joint) * fit.weight, 0.0, 1.0)
    if coarse := tuple(np.flatnonzero(share > COARSE).tolist()):
        detail = "accelerations are noisier than the residual"
        part = _part(fit, share, covariance)
        yield Effect("coarse encoders", coarse, detail, still, part)
    period, enough = max(s.period for _, s in joint.prepared), HALF_WIDTH / FEWEST_IN_WINDOW
    if period > enough * (1 + 1e-9):
        detail = f"{1e3 * period:g} ms; {1e3 * enough:g} ms is sufficient"
        part = (1.0 - enough / period) * covariance
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
        detail = f"{each} % of it, or offsets of the current"
        yield "friction that differs by direction", failed, detail, fit.solve_without_asymmetry()


def _format_errors(factor: float, value: Array, error: Array, axes: Indices) -> str:
    return ", ".join(f"{factor * value[k]:.2g} ± {factor * error[k]:.1g}" for k in axes)


def _part(fit: SimultaneousFit, share: Array, covariance: Array) -> Array:
    """Return the part of `covariance` due to a share of the axes' residual variance."""
    G = fit.noise_covariance[: fit.n_base]
    white = np.diag(G)
    scale = np.sqrt(np.diag(covariance) / np.where(white > 0, white, np.inf))
    part: Array = (G @ fit.information_of(share) @ G.T) * np.outer(scale, scale)
    return part


def _encoder_noise(robot: Robot, joint: Joint) -> Array:
    """Estimate the variance of smoothed torque due to encoder noise, by axis [(N m)^2].

    Noise shows in eighth differences of positions in steady motion, which leave nothing of the
    motion.
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
