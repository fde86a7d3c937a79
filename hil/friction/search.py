"""The search of a law of friction: the simplest that none beats by more than chance.

What an axis's friction was in groups of samples, such as measurements, stands in blocks of one
channel with a column for each term (`hil.friction.terms`). Every law is fitted to all groups but
those that are held out in turn, and predicts these (`hil.least_squares.choice`). Coulomb's and
viscous friction stands unless the data call for another law: simpler ones would save an unknown and
be taken wherever there are too few groups to show anything.

A group's error counts as one draw, since friction's level stays much the same in a measurement and
differs in the next: covariances are Huber's sandwich over groups. How far the level wanders is the
greatest of the differences from one of the factors by which the law's level fits each of them.
Where the warmth of the gear explains how the level changed (`hil.friction.warmth`), the law is that
at the mean warmth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.friction.direction import Direction
from hil.friction.law import AxisLaw, TermValue
from hil.friction.terms import CLASSICAL, DIRECTED, LAWS, USUAL, friction_columns
from hil.friction.warmth import Exposure, deviations, find_warmth, states_at
from hil.least_squares.choice import HeldOut, simplest
from hil.least_squares.regression import Regression

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hil.arrays import Array
    from hil.friction.warmth import History
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.regression import Fit


BEYOND = 1.25
"""Share of the speed limit up to which extrapolation is stated; faster than that it stays so."""
TRIED = tuple(LAWS)[tuple(LAWS).index(USUAL) :]
"""Laws, from the usual one on."""


def axis_law(
    measured: Blocks,
    speed: float,
    speeds: tuple[float, float],
    time: Array,
    past: History | None,
    axis: int,
) -> AxisLaw:
    """Law of friction of one axis.

    Parameters
    ----------
    measured : Blocks
        One channel with the terms that laws are made of; a group for each measurement, in the order
        of time.
    speed : float
        That velocities are divided by [rad/s or m/s].
    speeds : tuple of two floats
        Slowest and fastest samples [rad/s or m/s].
    time : ndarray, shape (n,)
        Of the middle of each measurement [s].
    past : History, optional
        What the axes did; without it no warmth is looked for.
    axis : int
        From 0, in the history.
    """
    tried = {name: LAWS[name] for name in TRIED if set(LAWS[name]) <= set(measured.own)}
    system = measured.normal(np.ones(1))
    held_out = HeldOut(system, system)
    errors = {name: held_out.error(measured.place(*law) - 1) for name, law in tried.items()}
    law = simplest(errors)
    terms, fit = LAWS[law], _fit(measured, LAWS[law])
    values, covariance, own = fit.x, fit.covariance, measured.only((), terms)
    warm = None if past is None else find_warmth(own, time, past, axis)
    if warm is not None:
        values, covariance = warm.values, warm.covariance
    plain, away, exposure = _fit(measured, CLASSICAL), deviations(own, values), None
    if past is not None and np.isfinite(past.speed[:, axis]).all():
        level = sum(term in DIRECTED for term in terms)
        exposure = Exposure.of(states_at(past, axis, time), away, level)
    return AxisLaw(
        law=law,
        speed=speed,
        terms=TermValue.named(terms, values, covariance),
        plain=TermValue.named(CLASSICAL, plain.x, plain.covariance),
        held_out=relative_errors(errors, law),
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        wander=float(np.abs(away).max()),
        exposure=exposure,
        speeds=speeds,
        unseen=unseen(measured, {law: LAWS[law], **tried}, errors, speed, speeds),
        measurements=len(measured),
        warmth=None if warm is None else warm.warmth,
    )


def unseen(
    measured: Blocks,
    tried: Mapping[str, tuple[str, ...]],
    errors: Mapping[str, Array],
    speed: float,
    speeds: tuple[float, float],
) -> tuple[tuple[float, float], ...]:
    """Return how uncertain friction is at speeds that no sample had.

    All laws that were tried are fitted to all samples. From the nearest speed seen they let
    friction change by Delta_m; the law that was chosen goes on in a straight line, by Delta. With
    weights w_m, the root mean square error on held-out groups of the law chosen over theirs,

        s^2 = sum w_m (Delta_m - Delta)^2 / sum w_m.

    Parameters
    ----------
    tried : mapping
        Terms of each law, the one that was chosen first.
    errors : mapping
        Squared errors on held-out groups, by law.
    speed : float
        Limit of the axis, by which velocities are divided [rad/s or m/s].
    speeds : tuple of two floats
        Slowest and fastest samples [rad/s or m/s].

    Returns
    -------
    tuple of (speed, standard deviation)
        [rad/s or m/s], [N m or N]; 0 at `speeds`.
    """
    low, high = speeds
    chosen, *_ = tried
    # the laws bend most near rest, the cube root at every scale
    slow = low * np.array([0.0, 0.05, 0.15, 0.4, 0.7, 1.0])
    fast = np.linspace(high, max(high, BEYOND * speed), 4)
    v, nearest = np.append(slow, fast), np.repeat([low, high], [len(slow), len(fast)])
    slope = _fit(measured, CLASSICAL).x[CLASSICAL.index("viscous")] / speed
    squares, total, worse = np.zeros(len(v)), 0.0, relative_errors(errors, chosen)
    for name, terms in tried.items():
        x = _fit(measured, terms).x
        change = _level(v / speed, terms, x) - _level(nearest / speed, terms, x)
        weight = 1.0 / worse[name]
        squares += weight * (change - slope * (v - nearest)) ** 2
        total += weight
    return tuple(zip(v.tolist(), np.sqrt(squares / total).tolist(), strict=True))


def _level(u: Array, terms: tuple[str, ...], x: Array) -> Array:
    """Level of friction at speeds above 0 and no load, shape of `u`; that of rest is its limit."""
    forward, back = (
        friction_columns(side * u, Direction(side * np.ones_like(u), np.zeros_like(u)), terms=terms)
        for side in (1.0, -1.0)
    )
    return np.asarray((forward - back) @ x / 2)


def relative_errors(errors: Mapping[str, Array], chosen: str) -> dict[str, float]:
    """Root mean square errors on held-out groups, over that of the alternative chosen.

    Errors below rounding of the largest count as rounding: data without noise leave nothing else.
    """
    sums = {name: float(error.sum()) for name, error in errors.items()}
    rounding = np.finfo(float).eps ** 2 * max(sums.values()) or np.finfo(float).tiny
    own = max(sums[chosen], rounding)
    return {name: float(np.sqrt(max(each, rounding) / own)) for name, each in sums.items()}


def _fit(measured: Blocks, terms: tuple[str, ...]) -> Fit:
    return Regression(measured.only((), terms), np.ones(1), np.arange(len(terms))).fit("clusters")
