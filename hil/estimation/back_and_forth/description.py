"""Describe a solution as in `model.yaml`: friction curves, residuals, restrictions.

A half-difference less its rigid-body part is the friction at the mean of the speeds forth and back.
Each pair gives one value in each class of speed. The curve is the mean over pairs, with a
confidence interval by Student's t. Friction that drifts from pair to pair widens the interval, as
intended: the interval is that of the mean over the given recordings.

The half-sums of each bin are averaged over pairs, less residual friction and the part that depends
on the direction; the rest is the rigid-body torque, which is gravity where the axis moves at
constant speed. The standard error is that of the scatter between pairs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.back_and_forth.halves import COMMON, known, numbered_pairs
from hil.estimation.back_and_forth.result import Combination, CurvePoint, FrictionCurve
from hil.estimation.back_and_forth.solution import NOTICEABLE
from hil.estimation.condensed import ROTOR
from hil.estimation.free_motion.description import Residuals, loose_parameters
from hil.estimation.free_motion.result import LOOSE
from hil.friction.law import TermValue
from hil.friction.terms import CLASSICAL
from hil.least_squares.blocks import Blocks
from hil.least_squares.uncertainty import leave_one_out
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.back_and_forth.halves import Halves
    from hil.estimation.back_and_forth.solution import Excitation, Solution
    from hil.model.robot import Robot

CLASSES = 12
"""Number of speed classes of equal width: 1.5 times the 8 speeds at which the friction of a
recording is interpolated.
"""


@dataclass(frozen=True, slots=True, eq=False)
class HalfSums:
    """Rigid-body torque over the positions of an axis in a recording.

    Attributes
    ----------
    axis : int
        Axis from 0.
    q : ndarray, shape (n,)
        Positions [rad or m].
    measured, standard_error, model : ndarray, shape (n,)
        Torques [N m or N]; standard errors are NaN for bins with one pair.
    """

    axis: int
    q: Array
    measured: Array
    standard_error: Array
    model: Array


def half_sums(halves: Halves, solution: Solution) -> HalfSums:
    """Return the half-sums of a recording."""
    around = solution.residual_row(halves.axis)
    sums = halves.rows[0] / np.sqrt(halves.pairs.weights)[:, np.newaxis]
    base = slice(1, len(around) - len(COMMON))
    model = -sums[:, base] @ around[base]
    left = sums @ solution.eliminate_levels(halves) @ around
    number = np.unique(halves.pairs.bin, return_inverse=True)[1]
    n = np.bincount(number).astype(float)
    q, modelled, rest, square = (
        np.bincount(number, x) / n for x in (halves.q[:, halves.axis], model, left, left**2)
    )
    error = np.sqrt(np.maximum(square - rest**2, 0.0) / np.where(n > 1, n - 1, np.nan))
    return HalfSums(halves.axis, q, modelled + rest, error, modelled)


def friction_curves(recordings: Sequence[Halves], solution: Solution) -> tuple[FrictionCurve, ...]:
    """Return the friction curves of the moved axes."""
    axes = sorted({each.axis for each in recordings})
    return tuple(_curve([e for e in recordings if e.axis == axis], solution) for axis in axes)


def _curve(recordings: Sequence[Halves], solution: Solution) -> FrictionCurve:
    axis, fit = recordings[0].axis, solution.fit
    around = solution.residual_row(axis)
    left = np.concatenate([each.rows[1, :, : len(around)] @ around for each in recordings])
    weight = np.concatenate([each.pairs.weights for each in recordings])
    speed = np.concatenate([each.speed for each in recordings])
    pair = numbered_pairs(recordings)
    places = [fit.layout.index(name, axis) for name in ("offset", "asymmetric")]
    constant, per_speed = (TermValue.estimated(fit.x[k], fit.covariance[k, k]) for k in places)
    friction = left / np.sqrt(weight)
    width = max(float(np.ptp(speed)) / CLASSES, np.finfo(float).tiny)
    of_class = np.minimum((speed - speed.min()) // width, CLASSES - 1)
    return FrictionCurve(
        axis=axis + 1,
        points=tuple(
            _point(speed[own], friction[own], weight[own], pair[own])
            for own in (of_class == k for k in np.unique(of_class))
        ),
        by_direction=(constant, per_speed),
        plain=_plain(recordings, around[: -1 - len(COMMON)]),
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


def _plain(recordings: Sequence[Halves], around: Array) -> dict[str, TermValue]:
    """Fit offset, Coulomb and viscous friction, with a covariance by leaving out pairs."""
    whole, n = np.concatenate([each.whole for each in recordings]), len(around)
    if len(whole) == 1:
        return {}
    found = leave_one_out(whole[:, n:, n:], whole[:, n:, :n] @ around)
    return TermValue.named(CLASSICAL, found.x, found.covariance)


def samples(robot: Robot, recordings: Sequence[Halves]) -> Blocks:
    """Sum products of torque and known columns over the used samples, by recording and axis."""
    columns = known(robot)
    n = 1 + len(columns)
    products = np.zeros((len(recordings), robot.n_joints, n, n))
    counts = np.zeros(products.shape[:2])
    for k, each in enumerate(recordings):
        products[k, each.axis], counts[k, each.axis] = each.samples[:n, :n], len(each.pairs.used)
    return Blocks(columns[: -len(COMMON)], COMMON, products, counts)


def residuals(whole: Blocks, recordings: Sequence[Halves], solution: Solution) -> Residuals:
    """Return the residuals of a solution over the used samples, levels of friction fitted."""
    left = np.zeros(whole.n_channels)
    for each in recordings:
        around = solution.eliminate_levels(each) @ solution.residual_row(each.axis)
        left[each.axis] += max(float(around @ each.samples @ around), 0.0)
    counts = np.maximum(whole.total.counts[0], 1.0)
    # recorded torque, with the torque of known rotors
    recorded = np.eye(1, whole.products.shape[-1])
    recorded[0, whole.place(ROTOR)] = 1.0
    torque = np.sqrt(whole.recast(recorded).squares / counts)
    return Residuals(np.sqrt(left / counts), torque, np.zeros_like(torque))


def combinations(robot: Robot, excited: Excitation) -> tuple[Combination, ...]:
    """Return the sums of parameters that are identified in place of single parameters."""
    names = base_parameters(robot).names
    found = []
    for k in excited.kept.tolist():
        shares = excited.combination[k]
        shown = np.flatnonzero(np.abs(shares) > NOTICEABLE * np.abs(shares).max()).tolist()
        terms = [_term(names[j], float(shares[j])) for j in shown if j != k]
        if terms:
            found.append(Combination(name=names[k], stands_for=" ".join([names[k], *terms])))
    return tuple(found)


def _term(name: str, share: float) -> str:
    sign, size = "-" if share < 0 else "+", abs(share)
    return f"{sign} {name}" if round(size, 3) == 1.0 else f"{sign} {size:.3g} {name}"


def remarks(
    robot: Robot, recordings: Sequence[Halves], whole: Blocks, solution: Solution, left: Residuals
) -> Iterator[str]:
    """Yield remarks on the restrictions of the estimate."""
    moved = {each.axis for each in recordings}
    never = [str(axis + 1) for axis in range(robot.n_joints) if axis not in moved]
    if never:
        yield (
            f"no strokes of axis {', '.join(never)}: its torque is not used, because static "
            "friction carries an unknown share; record strokes of this axis too"
        )
    single = sum(len(each.pairs) == 1 for each in recordings)
    if single:
        yield (
            f"{single} of {len(recordings)} recordings have one pair of strokes, too few to see "
            "changes of friction between forth and back; record two pairs or more"
        )
    also = [each.id for each in recordings if each.also_moving]
    if also:
        axes = sorted({axis + 1 for each in recordings for axis in each.also_moving})
        yield (
            f"besides the stated axis, axis {', '.join(map(str, axes))} moved in "
            f"{', '.join(also)}; the model includes this motion"
        )
    loose = loose_parameters(robot, whole, solution.fit, left.torque)
    if loose:
        yield (
            f"{', '.join(loose)}: a standard error is more than {100 * LOOSE:g} % of an axis's"
            " torque; record strokes at other positions of the axes"
        )
