"""Friction, residuals and restrictions of a solution, in the words of `model.yaml`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.free_motion.accumulation import SPEEDS
from hil.estimation.free_motion.bristles import Direction
from hil.estimation.free_motion.friction_terms import (
    BENT,
    CLASSICAL,
    COLUMNS,
    LAWS,
    friction_columns,
)
from hil.estimation.free_motion.result import (
    FEW_BLOCKS,
    LOOSE,
    POOR,
    AxisFriction,
    CoupledFriction,
    LagValue,
    OneWay,
    TermValue,
)
from hil.estimation.free_motion.system import only_directions, squares_left, summed
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice
    from hil.estimation.free_motion.gathering import Gathered
    from hil.estimation.free_motion.solution import Solution
    from hil.estimation.free_motion.survey import Survey
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

SHORT = 30.0
"""Duration of all recordings below which a remark is made [s]."""
SURE = 2.0
"""Standard errors by which friction drives an axis before that counts."""


def axis_friction(
    solution: Solution, plain: Solution, gathered: Gathered, products: Products, n_base: int
) -> tuple[AxisFriction, ...]:
    """Law and coefficients of each axis; `plain` is the solution with the classical law."""
    choice, processing, n_shared = gathered.choice, gathered.processing, products.n_shared
    levels = gathered.drift.found(solution.x, n_shared, len(products.pieces))

    def values(found: Solution, axis: int, law: Sequence[str]) -> dict[str, TermValue]:
        first = n_shared + axis * len(COLUMNS)
        return {term: _value(found, first + COLUMNS.index(term)) for term in law}

    def covariances(axis: int, law: Sequence[str]) -> dict[str, list[list[float]]]:
        first = n_shared + axis * len(COLUMNS)
        rows = solution.covariance[[first + COLUMNS.index(term) for term in law]]
        own = rows[:, [first + COLUMNS.index(term) for term in law]]
        return {"covariance": own.tolist(), "beside": rows[:, :n_base].tolist()}

    one_way = _one_way(products, solution)
    return tuple(
        AxisFriction(
            law=law,
            speed=float(processing.speed[axis]),
            presliding=float(processing.presliding[axis]),
            bend=values(solution, axis, (BENT,))[BENT],
            terms=values(solution, axis, LAWS[law]),
            plain=values(plain, axis, CLASSICAL),
            held_out=choice.held_out[axis],
            level=tuple(levels[axis].tolist()),
            one_way=one_way.get(axis),
            **covariances(axis, LAWS[law]),
        )
        for axis, law in enumerate(choice.laws)
    )


def _one_way(products: Products, solution: Solution) -> dict[int, OneWay]:
    """Axes, from 0, that move in one direction only."""
    found = {}
    for axis, direction in enumerate(only_directions(products.pieces, products.n_shared)):
        if direction:
            first = products.n_shared + axis * len(COLUMNS)
            places = [first + COLUMNS.index(term) for term in ("offset", "Coulomb")]
            both = np.array([1.0, direction])
            variance = float(both @ solution.covariance[np.ix_(places, places)] @ both)
            found[axis] = OneWay(
                direction=int(direction),
                together=TermValue.estimated(float(both @ solution.x[places]), variance),
            )
    return found


def torque_lags(gathered: Gathered) -> tuple[LagValue, ...]:
    """Lag of each axis's torque."""
    both = zip(gathered.processing.lag, gathered.lag_error, strict=True)
    return tuple(LagValue(value=float(lag), standard_error=float(error)) for lag, error in both)


def coupled_friction(robot: Robot, solution: Solution) -> tuple[CoupledFriction, ...]:
    """Friction of the coupled motors."""
    first = len(base_parameters(robot))
    return tuple(
        CoupledFriction(
            motor=motor + 1,
            joint=joint + 1,
            viscous=_value(solution, first + 2 * k),
            coulomb=_value(solution, first + 2 * k + 1),
        )
        for k, (motor, joint, _) in enumerate(robot.couplings)
    )


class Residuals(NamedTuple):
    """Of all samples, at every speed.

    Attributes
    ----------
    rms : ndarray, shape (n_joints,)
        Root mean square [N m or N].
    relative, naive : ndarray, shape (n_joints,)
        Over that of the torque; what the mean torque leaves, likewise. NaN for an axis without any.
    overall : float
        Relative, of all axes.
    """

    rms: Array
    relative: Array
    naive: Array
    overall: float


def residuals(products: Products, solution: Solution) -> Residuals:
    """What a solution leaves of the torques, and what their means leave."""
    counts, pieces = summed(products.counts), summed(products.pieces)
    squares = squares_left(pieces, counts, products.n_shared, solution.x)
    torque = products.squares / np.maximum(counts.sum(axis=0), 1.0)
    some = np.where(torque > 0, torque, np.nan)
    total = float(np.sqrt(squares.sum() / max(float(torque.sum()), np.finfo(float).tiny)))
    # by the column of the offset, which is 1 throughout
    mean = pieces[:, :, 0, 1 + products.n_shared].sum(axis=0) / np.maximum(counts.sum(axis=0), 1.0)
    naive = np.sqrt(np.maximum(torque - mean**2, 0.0) / some)
    return Residuals(np.sqrt(squares), np.sqrt(squares / some), naive, total)


def remarks(
    robot: Robot, products: Products, solution: Solution, found: Survey, condition: float
) -> tuple[str, ...]:
    """What restricts the estimate: too little data, poor excitation, axes that stand still.

    `condition` is that with the classical law of friction: terms of richer ones resemble each
    other, whatever the motion.
    """
    said = []
    if found.duration < SHORT or len(products.pieces) < FEW_BLOCKS:
        said.append(
            f"{found.duration:.3g} s of recordings are little: intervals show less than may be"
            f" wrong; add some, {SHORT:g} s or more"
        )
    if condition > POOR:
        said.append(
            f"condition number {condition:.3g}: some combinations of parameters and"
            " friction hardly show in the torque; add recordings of other motions"
        )
    if found.still:
        axes = ", ".join(str(axis + 1) for axis in found.still)
        said.append(f"axis {axes} stands still in all recordings: its friction is not identified")
    for axis, one in _one_way(products, solution).items():
        said.append(
            f"axis {axis + 1} {one} {robot.torque_unit(axis)}; add recordings in both directions"
        )
    if not solution.possible:
        said.append(
            "the mass matrix is not positive definite, and no parameters that make it so explain"
            " the torques as well: leave them out of simulations; check signs, units, gear ratios"
            " and torque constants of the map and the robot file, and add recordings with greater"
            " acceleration"
        )
    elif solution.moved:
        said.append(
            "least squares alone had a mass matrix that is not positive definite; parameters were"
            f" moved by at most {solution.moved:.2g} standard errors to mend that"
        )
    return (*said, *_loose(robot, products, solution))


def driving_axes(solution: Solution, n_shared: int, n_joints: int) -> tuple[int, ...]:
    """Axes, from 1, whose law of friction gives power at some speed, by more than chance."""
    forth, found = np.array([0.25, 0.5, 0.75, 1.0]), []
    u, still = np.append(forth, -forth), np.zeros(2 * len(forth))
    columns = friction_columns(u, Direction(np.sign(u), still), still, still, still)
    # what offsets and asymmetry add in one direction they take in the other
    braking = (columns[: len(forth)] - columns[len(forth) :]) / 2
    for axis in range(n_joints):
        own = n_shared + axis * len(COLUMNS) + np.arange(len(COLUMNS))
        V = solution.covariance[np.ix_(own, own)]
        error = np.sqrt(np.einsum("nk,kl,nl->n", braking, V, braking).clip(0.0))
        if (braking @ solution.x[own] < -SURE * error).any():
            found.append(axis + 1)
    return tuple(found)


def _loose(robot: Robot, products: Products, solution: Solution) -> list[str]:
    """Parameters whose standard error is a noticeable share of an axis's torque."""
    base = base_parameters(robot)
    n, counts = len(base), np.maximum(products.counts.sum(axis=(0, 2)), 1.0)
    squares = np.einsum("bjskk->jk", products.pieces)[:, 1 : 1 + n] / counts[:, np.newaxis]
    error = np.sqrt(np.diag(solution.covariance)[:n] * squares)
    torque = np.sqrt(np.maximum(products.squares / counts, np.finfo(float).tiny))
    worst = (error / torque[:, np.newaxis]).max(axis=0)
    names = [base.names[k] for k in np.flatnonzero(worst > LOOSE)]
    if not names:
        return []
    return [
        f"{', '.join(names)}: a standard error is more than {100 * LOOSE:g} % of an axis's torque;"
        " the motion excites them little"
    ]


def dead_zone(choice: Choice) -> float:
    """Share of the speed below which samples were not fitted."""
    return SPEEDS[choice.slowest - 1] if choice.slowest else 0.0


def _value(solution: Solution, place: int) -> TermValue:
    return TermValue.estimated(solution.x[place], solution.covariance[place, place])
