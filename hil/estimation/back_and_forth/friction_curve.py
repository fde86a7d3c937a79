"""Friction of each axis over its speed, read off the half-differences.

Once the base parameters are known, a half-difference less what of it is rigid bodies' is the
friction at the mean of both speeds. Each pair gives one value in each class of speed; the mean over
pairs and its interval, by Student's t, are the curve. Friction that drifts from pair to pair widens
the interval, as it should: it is that of the mean over these recordings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.back_and_forth.halves import COMMON, FIRST, MOTOR, TORQUE, unknown_places
from hil.estimation.back_and_forth.result import CurvePoint, FrictionCurve
from hil.estimation.free_motion.friction_terms import CLASSICAL
from hil.estimation.free_motion.result import TermValue
from hil.least_squares.uncertainty import leave_one_out

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.back_and_forth.halves import Halves
    from hil.estimation.back_and_forth.solution import Solution
    from hil.model.robot import Robot

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]

CLASSES = 12
"""Of speed, alike in width; those that no stroke has are left out."""


def friction_curves(
    robot: Robot, recordings: Sequence[Halves], solution: Solution
) -> tuple[FrictionCurve, ...]:
    """Curves of all axes that were moved."""
    axes = sorted({each.axis for each in recordings})
    return tuple(
        _curve(robot, [each for each in recordings if each.axis == axis], solution) for axis in axes
    )


def friction_of(robot: Robot, halves: Halves, x: Array) -> Array:
    """Friction at the bins of one recording, shape (n,) [N m or N]."""
    places = unknown_places(robot, halves.axis)
    columns = halves.differences
    rigid = columns[:, FIRST : FIRST + len(places)] @ x[places]
    return np.asarray(columns[:, TORQUE] - columns[:, MOTOR] - rigid)


def _curve(robot: Robot, recordings: Sequence[Halves], solution: Solution) -> FrictionCurve:
    axis = recordings[0].axis
    speed, weight = (
        np.concatenate([getattr(each, name) for each in recordings]) for name in ("speed", "weight")
    )
    friction = np.concatenate([friction_of(robot, each, solution.x) for each in recordings])
    first = np.cumsum([0, *(int(each.pair.max()) + 1 for each in recordings)])
    pair = np.concatenate([each.pair + k for each, k in zip(recordings, first, strict=False)])
    scale = 1.0, 1.0 / recordings[0].greatest_speed
    places = unknown_places(robot, axis)[-COMMON:][:2]
    errors = np.sqrt(np.diag(solution.covariance)[places])
    constant, per_speed = (
        TermValue(value=float(k * value), standard_error=float(k * error))
        for k, value, error in zip(scale, solution.x[places], errors, strict=True)
    )
    return FrictionCurve(
        axis=axis + 1,
        points=_points(speed, friction, weight, pair),
        by_direction=(constant, per_speed),
        plain=_plain(robot, recordings, solution.x),
    )


def _points(speed: Array, friction: Array, weight: Array, pair: Indices) -> tuple[CurvePoint, ...]:
    width = max(float(np.ptp(speed)) / CLASSES, 1e-12)
    of_class = np.minimum((speed - speed.min()) // width, CLASSES - 1)
    return tuple(
        _point(speed[own], friction[own], weight[own], pair[own])
        for own in (of_class == k for k in np.unique(of_class))
    )


def _point(speed: Array, friction: Array, weight: Array, pair: Indices) -> CurvePoint:
    number = np.unique(pair, return_inverse=True)[1]
    means = np.bincount(number, weight * friction) / np.bincount(number, weight)
    n, half = len(means), None
    if n > 1:
        half = float(special.stdtrit(n - 1, 0.975) * means.std(ddof=1) / np.sqrt(n))
    return CurvePoint(
        speed=float(np.average(speed, weights=weight)),
        friction=float(means.mean()),
        half_width=half,
        pairs=n,
    )


def _plain(robot: Robot, recordings: Sequence[Halves], x: Array) -> dict[str, TermValue]:
    """Offset, Coulomb's and viscous friction by least squares, pairs left out in turn."""
    shares, sides = [], []
    for each in recordings:
        places = unknown_places(robot, each.axis)[:-COMMON]
        around = np.concatenate([[1.0, -1.0], -x[places]])
        rigid = len(around)
        shares.append(each.whole[:, rigid:, rigid:])
        sides.append(each.whole[:, rigid:, :rigid] @ around)
    N, v = np.concatenate(shares), np.concatenate(sides)
    if len(N) == 1:
        return {}
    found = leave_one_out(N, v)
    rows = zip(CLASSICAL, found.x, np.diag(found.covariance), strict=True)
    return {name: TermValue.estimated(value, variance) for name, value, variance in rows}
