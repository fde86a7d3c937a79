"""Selection of a friction law: the simplest law that no other law beats by more than chance.

The friction of an axis in groups of samples, such as measurements, is given as blocks of one
channel with a column for each term (`hil.friction.terms`). Every law is fitted without a part of
the groups and predicts the held-out groups, for all parts in turn (`hil.least_squares.choice`).
Coulomb and viscous friction is the simplest law tried: even simpler laws would win wherever a few
groups cannot show a difference.

The error of a group counts as one draw, since the level of friction hardly changes within a
measurement and differs in the next one: covariances are Huber's sandwich over groups. `wander` is
the largest deviation from 1 of the factors that fit the level of the law to each group. Where the
warmth of the gear explains the changes of the level (`hil.friction.warmth`), the law applies at the
mean warmth.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hil.friction.direction import Direction
from hil.friction.law import AxisLaw, TermValue
from hil.friction.terms import CLASSICAL, LAWS, USUAL, friction_columns
from hil.friction.warmth import (
    Exposure,
    deviations,
    find_warmth,
    lost_degrees,
    squared_errors,
    states_at,
)
from hil.least_squares.choice import HeldOut, simplest
from hil.least_squares.regression import Regression

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hil.arrays import Array
    from hil.friction.warmth import History
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.regression import Fit


BEYOND = 1.25
"""Share of the speed limit up to which extrapolation is computed; constant beyond."""
TRIED = tuple(LAWS)[tuple(LAWS).index(USUAL) :]
"""Candidate laws: the usual law and all richer laws."""


def axis_law(
    measured: Blocks,
    speed: float,
    speeds: tuple[float, float],
    time: Array,
    past: History | None,
    axis: int,
    noise: float = 0.0,
) -> AxisLaw:
    """Select and fit the friction law of an axis.

    Parameters
    ----------
    measured : Blocks
        One channel with the terms of the laws; one group for each measurement, in the order of
        time.
    speed : float
        Reference speed, by which velocities are divided [rad/s or m/s].
    speeds : tuple of two floats
        Slowest and fastest samples [rad/s or m/s].
    time : ndarray, shape (n,)
        Middle of each measurement [s].
    past : History, optional
        History of the axes; without a history warmth is not estimated.
    axis : int
        Axis in the history, from 0.
    noise : float
        Sum of the squares that friction fitted to each measurement leaves [(N m)^2 or N^2].
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
        states = states_at(past, axis, time)
        exposure = Exposure.compute(states, away, lost_degrees(own, values))
    shape = float(squared_errors(own, values, 1.0 + away).sum()) - noise
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
        misfit=math.sqrt(max(shape, 0.0) / float(own.counts.sum())),
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
    """Compute the uncertainty of friction at speeds without samples.

    All candidate laws are fitted to all samples. Law m lets friction change by Delta_m from the
    nearest speed with samples; the chosen law continues in a straight line, by Delta. With weights
    w_m, the root mean square error of the chosen law on held-out groups over that of law m,

        s^2 = sum w_m (Delta_m - Delta)^2 / sum w_m.

    Parameters
    ----------
    tried : mapping
        Terms of each law, the chosen law first.
    errors : mapping
        Squared errors on held-out groups, by law.
    speed : float
        Reference speed of the axis, by which velocities are divided [rad/s or m/s].
    speeds : tuple of two floats
        Slowest and fastest samples [rad/s or m/s].

    Returns
    -------
    tuple of (speed, standard deviation)
        [rad/s or m/s], [N m or N]; 0 at `speeds`.
    """
    low, high = speeds
    chosen, *_ = tried
    # dense near rest, where the laws bend most; the cube root bends at every scale
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
    """Return the friction level without load at speeds `u`, shape of `u`; at rest its limit."""
    forward, back = (
        friction_columns(side * u, Direction(side * np.ones_like(u), np.zeros_like(u)), terms=terms)
        for side in (1.0, -1.0)
    )
    return np.asarray((forward - back) @ x / 2)


def relative_errors(errors: Mapping[str, Array], chosen: str) -> dict[str, float]:
    """Return root mean square errors on held-out groups, relative to the chosen alternative.

    Errors are at least the rounding error of the largest error, for data without noise.
    """
    sums = {name: float(error.sum()) for name, error in errors.items()}
    rounding = np.finfo(float).eps ** 2 * max(sums.values()) or np.finfo(float).tiny
    own = max(sums[chosen], rounding)
    return {name: float(np.sqrt(max(each, rounding) / own)) for name, each in sums.items()}


def _fit(measured: Blocks, terms: tuple[str, ...]) -> Fit:
    return Regression(measured.only((), terms), np.ones(1), np.arange(len(terms))).fit("clusters")
