"""Gains that a map leaves unknown, found from what axes share.

What fixes the scale of an axis of unknown gain is a torque of known size that it feels: base
parameters that it shares with an axis of known gain, or rotors whose inertia the robot file states.
Where neither is there, parameters, gain and friction may all be multiplied alike and nothing in the
torques changes; such a scale is refused rather than made up (`open_scale`).

The solution is found by Gauss and Newton's method (`scaling`), from two starts of which the better
end counts: gains that make torques of usual size, and those of the linear problem in which the
signals of unknown gain are columns,

    -Qm_i = A_i p + C_i c + F_i a_i - g_i y_i,

which noise and friction shift, at times far.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.free_motion.choice import without_choice
from hil.estimation.free_motion.friction_terms import CLASSICAL
from hil.estimation.free_motion.open_scale import (
    REMEDY,
    gains_of,
    mean_signal,
    require_scale,
    usual_torque,
)
from hil.estimation.free_motion.result import GainValue
from hil.estimation.free_motion.scaling import Scaling, recast
from hil.estimation.free_motion.system import kept_unknowns, squares_left, summed
from hil.model.base_parameters import base_parameters
from hil.regression.normal_equations import normal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice
    from hil.estimation.free_motion.solution import Solution
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

ROUNDS = 50
"""Of Gauss and Newton's method, at most."""
CONVERGED = 1e-10
"""Relative change of the gains at which it ends."""
STRIDE = 0.7
"""Largest change of a gain's logarithm in one round."""
FARTHEST = 1e3
"""Factor between a gain that makes torques of usual size and one that the linear problem gives."""
LOOSE = 0.2
"""Relative standard error of a gain from which on the recordings do not fix it."""


def first_scaling(robot: Robot, recorded: Products, unknown: tuple[int, ...]) -> Scaling:
    """Gains by Coulomb's and viscous friction at all speeds.

    Raises
    ------
    NotIdentifiable
        Parameters that the unknown gains leave open up to scale.
    """
    if not unknown:
        return Scaling.known(robot.n_joints)
    require_scale(robot, recorded, unknown)
    whole = _in_one_piece(recorded)
    usual = _usual(whole, unknown)
    starts = usual, _by_linear_problem(whole, unknown, usual)
    found = [_converged(whole, unknown, gains) for gains in starts]
    return min(found, key=lambda each: each[1])[0]


def _in_one_piece(recorded: Products) -> Products:
    """The same added up over time, which is all that a solution takes."""
    return replace(
        recorded,
        pieces=recorded.pieces.sum(axis=0, keepdims=True),
        counts=recorded.counts.sum(axis=0, keepdims=True),
        cells=recorded.cells[:0],
        instruments=None,
    )


def _converged(recorded: Products, unknown: tuple[int, ...], gains: Array) -> tuple[Scaling, float]:
    """Gains from some to begin with, and the logarithm of what they leave of the signals."""
    known = Scaling(gains, (), np.zeros(0)).applied(recorded)
    scaling = Scaling(gains, unknown, without_choice(known, weighted=True).solution(known))
    for _ in range(ROUNDS):
        products = scaling.applied(recorded)
        scaling, change = _step(scaling, products, without_choice(products, weighted=True))
        if change < CONVERGED**0.5:
            break
    return scaling, _misfit(recorded, scaling)


def _misfit(recorded: Products, scaling: Scaling) -> float:
    """Mean logarithm of the residual variances of the signals, up to a constant."""
    products = Scaling(scaling.gains, (), np.zeros(0)).applied(recorded)
    counts = summed(products.counts)
    left = squares_left(summed(products.pieces), counts, products.n_shared, scaling.x)
    floor = np.finfo(float).tiny
    return float(counts.sum(axis=0) @ np.log(np.maximum(left / scaling.gains**2, floor)))


def refined(recorded: Products, scaling: Scaling, choice: Choice) -> Scaling:
    """Gains by chosen laws of friction, with the choice's weights.

    Weights are of torques in SI; they are kept while the gains change.
    """
    whole = _in_one_piece(recorded)
    for _ in range(ROUNDS if scaling.unknown else 0):
        scaling, change = _step(scaling, scaling.applied(whole), choice)
        if change < CONVERGED:
            break
    return scaling


def _step(scaling: Scaling, products: Products, choice: Choice) -> tuple[Scaling, float]:
    """One round, and the largest change of a gain's logarithm."""
    x = choice.solution(products)
    places = _places(products, scaling)
    change = np.clip(x[places], -STRIDE, STRIDE)
    gains = scaling.gains.copy()
    gains[list(scaling.unknown)] *= np.exp(change)
    return Scaling(gains, scaling.unknown, np.delete(x, places)), float(np.abs(change).max())


def _places(products: Products, scaling: Scaling) -> NDArray[np.intp]:
    """Where changes of the unknown gains stand among all unknowns."""
    n = len(scaling.unknown)
    return np.arange(products.n_shared - n, products.n_shared, dtype=np.intp)


def _usual(recorded: Products, unknown: tuple[int, ...]) -> Array:
    """Gains that make the torques of all axes of usual size, shape (n_joints,)."""
    axes, gains = list(unknown), np.ones(recorded.n_joints)
    gains[axes] = np.sqrt(usual_torque(recorded, unknown) / mean_signal(recorded)[axes])
    return gains


def _by_linear_problem(recorded: Products, unknown: tuple[int, ...], usual: Array) -> Array:
    """Gains by the linear problem, not too far from usual ones, shape (n_joints,)."""
    n, axes = recorded.n_joints, list(unknown)
    linear = _linear(recorded, axes)
    kept = kept_unknowns(linear.n_shared, [CLASSICAL] * n)
    weights = 1.0 / (usual**2 * mean_signal(recorded))
    system = normal(summed(linear.pieces), linear.n_shared, weights)
    x = system.solution(kept)
    gains = usual.copy()
    gains[axes] = x[linear.n_shared - len(axes) : linear.n_shared]
    return np.clip(gains, usual / FARTHEST, usual * FARTHEST)


def _linear(recorded: Products, axes: Sequence[int]) -> Products:
    """Products of the linear problem; signals of unknown gain are the last shared columns."""
    n, rotor = recorded.n_joints, recorded.n_shared
    first = np.zeros((n, recorded.pieces.shape[-1]))
    first[:, 0], first[:, rotor] = 1.0, -1.0
    first[axes, 0] = 0.0
    added = np.zeros((*first.shape, len(axes)))
    added[axes, 0, np.arange(len(axes))] = -1.0
    return recast(recorded, first, np.arange(1, rotor), added, np.ones(n))


def found_gains(robot: Robot, scaling: Scaling, solution: Solution) -> tuple[GainValue, ...]:
    """Unknown gains of a solution with their standard errors.

    Raises
    ------
    NotIdentifiable
        Gains that the recordings hardly fix, and so all that depends on them.
    """
    first = len(base_parameters(robot)) + 2 * len(robot.couplings)
    places = first + np.arange(len(scaling.unknown))
    change, error = solution.x[places], np.sqrt(np.diag(solution.covariance)[places])
    loose = [axis for axis, each in zip(scaling.unknown, error, strict=True) if not each < LOOSE]
    if loose:
        raise NotIdentifiable(
            f"{gains_of(loose)} cannot be found: a standard error of"
            f" {100 * error.max():.2g} % must be below {100 * LOOSE:g} %, so the parameters are"
            f" determined only up to scale; {REMEDY}"
        )
    values = scaling.gains[list(scaling.unknown)] * np.exp(change)
    return tuple(
        GainValue(
            axis=axis + 1,
            value=float(value),
            standard_error=float(value * each),
            unit="N m" if robot.revolute[axis] else "N",
        )
        for axis, value, each in zip(scaling.unknown, values, error, strict=True)
    )
