"""Solvers, each over rows weighted axis by axis.

least squares
    as it stands;
positive
    the same, and if that makes the mass matrix negative anywhere on the motion, the nearest
    solution that does not (`hil.estimation.free_motion.positive`), unless the torques contradict
    it; its covariance counts what other laws of friction would have found
    (`hil.estimation.free_motion.alternatives`), and offsets of friction that pass for weight
    (`hil.estimation.free_motion.offsets`);
instrumental
    Z'W x = Z'y: Z from one half of the samples, every other one, and W from the other half. Errors
    of measurement that differ from sample to sample are in one of them only, so they shift nothing;
a function of the equations of pieces of time
    the equations as it weights them, and their solution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.free_motion.alternatives import covariance_of_choices
from hil.estimation.free_motion.choice import MATERIAL
from hil.estimation.free_motion.friction_terms import COLUMNS
from hil.estimation.free_motion.offsets import with_doubt
from hil.estimation.free_motion.positive import nearest_positive
from hil.estimation.free_motion.system import (
    only_directions,
    split_covariance,
    squares_left,
    summed,
)
from hil.estimation.free_motion.uncertainty import uncertainty
from hil.model.base_parameters import base_parameters
from hil.regression.layout import embedded
from hil.regression.least_squares import condition, inverse, undetermined
from hil.regression.normal_equations import normal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice
    from hil.model.robot import Robot
    from hil.regression.normal_equations import Normal

    Array = NDArray[np.float64]

Solver = (
    Literal["least squares", "positive", "instrumental"]
    | Callable[["Normal"], "tuple[Normal, Array]"]
)


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """All unknowns with their uncertainty.

    Attributes
    ----------
    x : ndarray, shape (n,)
        Base parameters, coupled motors' friction, all terms of each axis's friction; 0 where a law
        has no such term.
    covariance : ndarray, shape (n, n)
    degrees_of_freedom : ndarray, shape (n,)
    condition : float
        Of the weighted observation matrix, columns at unit length.
    moved : float
        Change of the unknowns that makes the mass matrix positive, over their standard errors.
    possible : bool
        Whether they were moved; else the torques contradict it.
    unusual : tuple of int
        Axes, from 0, whose offset is larger than friction's usually is, and passes for weight.
    """

    x: Array
    covariance: Array
    degrees_of_freedom: Array
    condition: float
    moved: float = 0.0
    possible: bool = True
    unusual: tuple[int, ...] = ()


def solve(
    robot: Robot, products: Products, choice: Choice, solver: Solver, configurations: Array
) -> Solution:
    """Solve for all unknowns.

    Parameters
    ----------
    configurations : ndarray, shape (n, n_joints)
        Some of the motion's, where the mass matrix must be positive.

    Raises
    ------
    NotIdentifiable
        Base parameters that the motion does not excite.
    """
    kept, n_shared = choice.kept(products.n_shared), products.n_shared
    pieces, cells = (
        normal(summed(each, choice.slowest), n_shared, choice.weights).only(kept)
        for each in (products.pieces, products.cells)
    )
    require_determined(robot, pieces)
    equations, found = _by_solver(solver, pieces, products, choice)
    error = uncertainty(equations, cells, found)
    n = n_shared + products.n_joints * len(COLUMNS)
    x, covariance = embedded(found, kept, n), embedded(error.covariance, kept, n)
    covariance += split_covariance(only_directions(products.pieces, n_shared), n_shared, x)
    solution = Solution(
        x=x,
        covariance=covariance,
        degrees_of_freedom=embedded(error.degrees_of_freedom, kept, n),
        condition=condition(pieces.information),
    )
    if solver != "positive":
        return solution
    covariance = solution.covariance + covariance_of_choices(products, choice)
    return _possible(
        robot, products, choice, replace(solution, covariance=covariance), configurations
    )


def _by_solver(
    solver: Solver, pieces: Normal, products: Products, choice: Choice
) -> tuple[Normal, Array]:
    """Equations as a solver weights them, and their solution."""
    if callable(solver):
        return solver(pieces)
    if solver == "instrumental" and products.instruments is not None:
        crossed = normal(products.instruments, products.n_shared, choice.weights)
        pieces = crossed.only(choice.kept(products.n_shared))
    return pieces, pieces.solution()


def _possible(
    robot: Robot, products: Products, choice: Choice, found: Solution, configurations: Array
) -> Solution:
    """Doubt unusual offsets, and make the mass matrix positive unless the torques contradict that.

    The move costs the least in what it leaves of the torques: its metric is that of the normal
    equations. A residual that grows by more than `MATERIAL` on any axis shows that something else
    is wrong; then parameters stay as they are.
    """
    kept, n_shared = choice.kept(products.n_shared), products.n_shared
    pieces = summed(products.pieces, choice.slowest)
    N = choice.equations(products).only(kept).information
    metric = embedded(inverse(N), kept, len(found.x))
    covariance, unusual = with_doubt(found.x, found.covariance, metric, n_shared)
    nearest = nearest_positive(robot, found.x, metric, configurations)
    error = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    moved = float(np.abs((nearest - found.x) / error)[kept].max(initial=0.0))
    counts = summed(products.counts, choice.slowest)
    before, after = (squares_left(pieces, counts, n_shared, x) for x in (found.x, nearest))
    possible = bool(np.all(after <= (1.0 + MATERIAL) ** 2 * before))
    return replace(
        found, x=nearest if possible else found.x, covariance=covariance, moved=moved,
        possible=possible, unusual=tuple(unusual),
    )  # fmt: skip


def require_determined(robot: Robot, pieces: Normal) -> None:
    """Refuse motions that leave base parameters open.

    Raises
    ------
    NotIdentifiable
    """
    names = base_parameters(robot).names
    lost = undetermined(pieces.information)[: len(names)]
    lost |= np.diag(pieces.information)[: len(names)] == 0
    if lost.any():
        listed = ", ".join(name for name, each in zip(names, lost, strict=True) if each)
        raise NotIdentifiable(
            f"the recorded motions do not excite {listed}; add recordings in which more joints"
            " move through more of their ranges, or state in the robot file which link parameters"
            " are present"
        )
