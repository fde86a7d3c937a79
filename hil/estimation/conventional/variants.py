"""The conventional methods by name, and what they estimate from recordings of trajectories."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.conventional.friction_terms import N_OF_SPEED
from hil.estimation.conventional.products import products
from hil.estimation.conventional.solution import solve
from hil.estimation.estimate import Estimate
from hil.planning.measurement import recorded_as
from hil.planning.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from hil.estimation.conventional.friction_terms import Characteristic, Terms
    from hil.estimation.conventional.products import Products
    from hil.estimation.conventional.solution import Solver, Weighting
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

SLOW = 0.05
"""Share of an axis's speed limit below which samples are left out: near standstill friction
depends on the way since the last reversal as well, which no term of these methods holds."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One conventional method.

    Attributes
    ----------
    terms : str
        Friction that is fitted jointly.
    weighting, solver : str
        See `hil.estimation.conventional.solution`.
    slowest : float
        Samples below this share of the speed limit are left out.
    by_period : bool
        Friction has coefficients of its own in each period of a trajectory.
    """

    terms: Terms
    weighting: Weighting = "residual"
    solver: Solver = "least squares"
    slowest: float = SLOW
    by_period: bool = False


VARIANTS: dict[str, Variant] = {
    "least squares, model 1": Variant("model 1", "uniform"),
    "torque weights, model 1": Variant("model 1", "torque"),
    "prior weights, model 1": Variant("model 1", "prior"),
    "residual weights, model 1": Variant("model 1"),
    "residual weights, model 2": Variant("model 2"),
    "all speeds, model 2": Variant("model 2", slowest=0.0),
    "instrumental, model 2": Variant("model 2", solver="instrumental"),
    "total, model 2": Variant("model 2", solver="total"),
    "strongest": Variant("rich"),
    "friction by period": Variant("rich", by_period=True),
}
"""Friction estimated jointly; a warm-up is a matter of the plan. Low speeds are left out, as
proponents of these methods do; "all speeds" shows what they cost. The last is no method of the
literature: it takes from the two-step method that friction is fitted anew again and again."""
COMPENSATED = Variant("none")
"""With a friction characteristic measured beforehand, which says nothing of reversals."""


def trajectories(
    recorded: Iterable[tuple[RecordedMotion, Recording]],
) -> list[tuple[Trajectory, Recording]]:
    """Return those of recorded measurements that are trajectories.

    Raises
    ------
    NotEnoughData
        There are none.
    """
    found = recorded_as(Trajectory, recorded)
    if not found:
        raise NotEnoughData(
            "no trajectories among the measurements; plan some with hil trajectory plan"
        )
    return found


def fit_trajectories(
    robot: Robot,
    recorded: Sequence[tuple[Trajectory, Recording]],
    variant: Variant,
    characteristics: Sequence[Characteristic] | None = None,
    name: str = "conventional",
) -> Estimate:
    """Identify base parameters from trajectories.

    Parameters
    ----------
    robot : Robot
    recorded : sequence of (Trajectory, Recording)
    variant : Variant
    characteristics : sequence of callable, optional
        Friction of each axis that is compensated beforehand, with `COMPENSATED`.
    name : str
        Of the method, for the estimate.
    """
    data = products(robot, recorded, variant.terms, variant.slowest, characteristics)
    return estimate_of(robot, data, variant, name)


def estimate_of(robot: Robot, data: Products, variant: Variant, name: str) -> Estimate:
    """Identify from condensed trajectories, which several variants can share.

    `data` may hold more columns of friction than the variant has.
    """
    if variant.terms != "rich":
        data = data.first(N_OF_SPEED[variant.terms])
    if variant.by_period:
        data = data.by_period(N_OF_SPEED[variant.terms])
    found = solve(data, robot.torque_limit, variant.weighting, variant.solver)
    n = data.n_base
    return Estimate(
        method=name,
        p=found.x[:n],
        covariance=found.covariance[:n, :n],
        degrees_of_freedom=np.full(n, max(found.n_blocks - 1.0, 1.0)),
        drive_covariance=np.zeros((n, n)),
        drive_effect=np.zeros((n, 2 * robot.n_joints)),
        residual=found.residual,
        n_measurements=data.n_trajectories,
        condition={"all": found.condition},
        local=(),
        left_out=(),
    )
