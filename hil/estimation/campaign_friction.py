"""Friction of each axis over a whole campaign, once the base parameters are found.

The methods for strokes and trajectories fit friction anew in every measurement, so that its drift
does no harm to the base parameters. What a drive has to overcome is found afterwards: of every
usable sample the torque less those of motors and rigid bodies,

    Q_i - Qm_i - A_i(q, qd, qdd) p = F_i a_i + e,

with one law F_i a_i for all measurements of an axis. The law is the simplest (`LAWS`, less ripple)
that no other one beats by more than chance on measurements held out. A measurement's error counts
as one draw, since friction's level stays much the same in it and differs in the next: covariances
are Huber's sandwich over measurements. How far the level wanders is
the greatest of the differences from one of the factors by which the law's level fits each of them.
Where the warmth of the gear explains how the level changed
(`hil.estimation.friction.warmth_choice`), the law is that at the mean warmth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.free_motion.friction_terms import CLASSICAL, LAWS
from hil.estimation.free_motion.result import TermValue
from hil.estimation.friction.warmth_choice import Levels, find_warmth
from hil.estimation.friction_law import DIRECTED, AxisLaw, FrictionLaw
from hil.least_squares.normal_equations import Normal
from hil.least_squares.solving import inverse
from hil.least_squares.terms import ASYMMETRIC, LOAD
from hil.least_squares.uncertainty import sandwich, scatter
from hil.planning.measurement import FOR_A_LAW

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from hil.estimation.condensed import Stacked
    from hil.estimation.friction.history import History
    from hil.estimation.friction.warmth_choice import WarmLaw
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

SPEED_TERMS = (
    "offset", "Coulomb", "viscous", "asymmetric", "cube root", "arc tangent", "quadratic", "load",
)  # fmt: skip
"""Terms of velocity and load, in the order of the columns here."""
_LAWS = {name: terms for name, terms in LAWS.items() if set(terms) <= set(SPEED_TERMS)}
FOLDS = 5
"""Parts of the measurements that are held out in turn."""
SURE = 2.0
"""Standard errors by which a law must be worse than the best for not to be taken."""


def campaign_friction(
    robot: Robot, p: Array, stacks: Iterable[Sequence[Stacked]], past: History | None = None
) -> FrictionLaw:
    """Find the law of friction of each axis.

    Parameters
    ----------
    robot : Robot
    p : ndarray, shape (n_base,)
        Base parameters that the same measurements gave.
    stacks : iterable of sequence of Stacked
        Of each measurement, or period of a trajectory, the axes that move.
    past : History, optional
        What the axes did; without it no warmth is looked for.
    """
    found: list[list[_Measured]] = [[] for _ in range(robot.n_joints)]
    for each in (each for axes in stacks for each in axes):
        v = np.abs(each.friction[:, 1]) * robot.velocity_limit[each.axis]
        speeds = float(v.min()), float(v.max())
        found[each.axis].append(_Measured(each.time, _products(each, p), speeds))
    axes_found = (
        _law(sorted(own, key=lambda each: each.time), axis, float(limit), past)
        for axis, (own, limit) in enumerate(zip(found, robot.velocity_limit, strict=True))
    )
    return FrictionLaw(axes=tuple(axes_found))


class _Measured(NamedTuple):
    """Time of an axis's share of a measurement, its products, its slowest and fastest sample."""

    time: float
    products: Array
    speeds: tuple[float, float]


def _products(each: Stacked, p: Array) -> Array:
    """Mean products of what is left for friction and its terms, shape (1 + n_terms, 1 + n_terms).

    A measurement counts by its duration, so they are multiplied by its number of samples.
    """
    n, constant = each.n_base, [each.n_base + k for k in ASYMMETRIC]
    loaded = each.loaded(each.load(p)).X[:, n + LOAD]
    left = each.torques[:, 0] - each.X[:, :n] @ p
    offset, asymmetric = each.X[:, constant].T
    direction, v, root, bend, square = each.friction[:, :5].T
    columns = np.column_stack([left, offset, direction, v, asymmetric, root, bend, square, loaded])
    return np.asarray(each.each * (columns.T @ columns))


def _law(
    measured: Sequence[_Measured], axis: int, limit: float, past: History | None
) -> AxisLaw | None:
    """Law of one axis from its measurements, in the order of time."""
    if len(measured) < FOR_A_LAW:
        return None
    products = np.array([each.products for each in measured])
    slowest, fastest = zip(*(each.speeds for each in measured), strict=True)
    name, held_out = _choice(products)
    values, covariance = _solution(products, _LAWS[name])
    plain, of_plain = _solution(products, CLASSICAL)
    if warm := _with_warmth(measured, products, _LAWS[name], axis, past):
        values, covariance = warm.values, warm.covariance
    return AxisLaw(
        law=name,
        speed=limit,
        terms=_terms(_LAWS[name], values, covariance),
        plain=_terms(CLASSICAL, plain, of_plain),
        held_out=held_out,
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        wander=_wander(products, _LAWS[name], values),
        speeds=(min(slowest), max(fastest)),
        measurements=len(products),
        warmth=None if warm is None else warm.warmth,
    )


def _with_warmth(
    measured: Sequence[_Measured],
    products: Array,
    terms: Sequence[str],
    axis: int,
    past: History | None,
) -> WarmLaw | None:
    if past is None:
        return None
    at = [0, *_places(terms)]
    levels = Levels(products[:, at][:, :, at], np.isin(terms, DIRECTED))
    return find_warmth(levels, np.array([each.time for each in measured]), past, axis)


def _choice(products: Array) -> tuple[str, dict[str, float]]:
    """Name of the law, and root mean square errors on held-out measurements over its own."""
    errors = {name: _held_out(products, terms) for name, terms in _LAWS.items()}
    best = min(errors, key=lambda name: float(errors[name].sum()))
    chosen = next(name for name, own in errors.items() if not _worse(own, errors[best]))
    least = float(errors[chosen].sum()) or 1.0
    return chosen, {name: float(np.sqrt(own.sum() / least)) for name, own in errors.items()}


def _worse(errors: Array, best: Array) -> bool:
    """Whether one law's errors, measurement by measurement, are greater by more than chance."""
    excess = errors - best
    chance = float(np.std(excess)) * np.sqrt(len(excess))
    return bool(excess.sum() > SURE * chance)


def _held_out(products: Array, terms: Sequence[str]) -> Array:
    """Squared error of each measurement by the law of the other folds, shape (n,)."""
    at = _places(terms)
    fold = np.arange(len(products)) % FOLDS
    errors = np.zeros(len(products))
    for k in range(FOLDS):
        values, _ = _solution(products[fold != k], terms)
        weights = np.concatenate([[1.0], -values])
        own = products[fold == k][:, [0, *at]][:, :, [0, *at]]
        errors[fold == k] = np.einsum("k,nkl,l->n", weights, own, weights)
    return errors


def _solution(products: Array, terms: Sequence[str]) -> tuple[Array, Array]:
    """Coefficients, shape (n_terms,), and their covariance by the measurements' scores."""
    at = [0, *_places(terms)]
    system = Normal.split(products[:, at][:, :, at])
    values = system.solution()
    return values, sandwich(inverse(system.information), scatter(system.scores(values), few=True))


def _wander(products: Array, terms: Sequence[str], values: Array) -> float:
    """Greatest difference of the level in a measurement from the law, as a share of it."""
    at = np.array(_places(terms))
    directed = np.isin(terms, DIRECTED)
    own, other = at[directed], at[~directed]
    level = np.einsum("k,nkl,l->n", values[directed], products[:, own][:, :, own], values[directed])
    common = (
        products[:, own, 0]
        - products[:, own][:, :, own] @ values[directed]
        - products[:, own][:, :, other] @ values[~directed]
    ) @ values[directed]
    shown = level > 0
    return float(np.abs(common[shown] / level[shown]).max(initial=0.0))


def _places(terms: Sequence[str]) -> list[int]:
    """Where terms stand among the columns, behind what is to be explained."""
    return [1 + SPEED_TERMS.index(term) for term in terms]


def _terms(names: Sequence[str], values: Array, covariance: Array) -> dict[str, TermValue]:
    rows = zip(names, values, np.diag(covariance), strict=True)
    return {name: TermValue.estimated(value, variance) for name, value, variance in rows}
