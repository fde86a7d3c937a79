"""Conventional identification (section 5 of the paper): one regression over exciting trajectories.

All joints move at once, and the base parameters come from Q = A(q, qd, qdd) p + friction in one
linear fit, eq. (11). Variants differ in how friction is treated (`friction_terms`), how rows are
weighted and how the overdetermined system is solved (`solution`). The table contains the variants
of the literature, and the strongest combinations known to us. Only the variants by period permit
friction to change during the measurement.

The column of load friction depends on the unknown base parameters. So methods with load friction
first solve without this column, compute the transmitted torques from the solution, and iterate to
convergence (Hamon, Gautier, Garrec 2010). The error of load friction is mu |error of Q_t|, so each
iteration multiplies the error by about mu.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.drive_train import LoadFriction
from hil.estimation.estimate import Estimate
from hil.friction.law import FrictionLaw
from hil.planning.measurement import select_kind
from hil.planning.trajectory import Trajectory

from .friction_terms import LOAD, N_OF_SPEED, places
from .products import stack
from .solution import solve

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    from .friction_terms import Characteristic, Terms
    from .products import Products, Stacked
    from .solution import Solution, Solver, Weighting

    Array = NDArray[np.float64]

SLOW = 0.05
"""Share of an axis's speed limit below which samples are excluded: near standstill, friction also
depends on the distance since the last reversal, for which these methods have no term.
"""
ROUNDS = 20
"""Maximum number of iterations of load friction and base parameters."""
SETTLED = 0.01
"""Change of parameters, relative to a standard error, at which the iteration ends. The change is
invisible in an interval, and the next one would be smaller by the factor mu.
"""


@dataclass(frozen=True, slots=True)
class Variant:
    """Conventional identification method.

    Attributes
    ----------
    terms : str
        Name of the friction terms in the fit.
    weighting, solver : str
        See `solution`.
    slowest : float
        Samples below this share of the speed limit are left out.
    by_period : bool
        True for separate friction coefficients in each period of a trajectory; offset, friction of
        the load and ripple are common to all periods.
    offset : bool
        True for an additional constant torque, which the rich set always contains.
    load : bool
        True for additional friction that grows with the transmitted torque.
    """

    terms: Terms
    weighting: Weighting = "residual"
    solver: Solver = "least squares"
    slowest: float = SLOW
    by_period: bool = False
    offset: bool = False
    load: bool = False


CUSTOMARY: dict[str, Variant] = {
    "least squares, model 1": Variant("model 1", "uniform"),
    "torque weights, model 1": Variant("model 1", "torque"),
    "prior weights, model 1": Variant("model 1", "prior"),
    "residual weights, model 1": Variant("model 1"),
    "residual weights, model 2": Variant("model 2"),
    "all speeds, model 2": Variant("model 2", slowest=0.0),
    "instrumental, model 2": Variant("model 2", solver="instrumental"),
    "total, model 2": Variant("model 2", solver="total"),
}
"""Friction models of the paper without changes. Low speeds are excluded, as by proponents of these
methods; the variant "all speeds" includes them.
"""
BOTH = "offset and load"
VARIANTS: dict[str, Variant] = {
    **CUSTOMARY,
    "residual weights, model 2, offset": Variant("model 2", offset=True),
    **{f"{name}, {BOTH}": replace(v, offset=True, load=True) for name, v in CUSTOMARY.items()},
    "strongest without load": Variant("rich"),
    "strongest": Variant("rich", load=True),
    "friction by period without load": Variant("rich", by_period=True),
    "friction by period": Variant("rich", by_period=True, load=True),
}
"""Variants with friction estimated jointly. Friction by period is not a method of the literature:
like the two-step method it fits friction anew in every period.
"""
COMPENSATED: dict[str, Variant] = {
    "": Variant("none"),
    "corrected": Variant("model 1", offset=True, load=True),
}
"""Variants with a friction characteristic measured beforehand, without values at reversals:
unchanged, or with level and slope, offset and load fitted to the trajectory. Without the level,
offset and load would compensate for a drift of the level, with larger errors.
"""


def trajectories(
    recorded: Iterable[tuple[RecordedMotion, Recording]],
) -> list[tuple[Trajectory, Recording]]:
    """Return the trajectories among recorded measurements.

    Raises
    ------
    NotEnoughData
        No trajectories.
    """
    found = select_kind(Trajectory, recorded)
    if not found:
        raise NotEnoughData(
            "no trajectories among the measurements; plan some with hil plan --kind trajectory"
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
        Name of the method in the estimate.
    """
    data = stack(robot, recorded, variant.slowest, characteristics)
    return estimate_of(robot, data, variant, name)


def estimate_of(robot: Robot, data: Stacked, variant: Variant, name: str) -> Estimate:
    """Identify from stacked trajectories, common to several variants."""
    n = data.products.n_base
    found = _solution(robot, data.products, variant, load=False)
    for _ in range(ROUNDS if variant.load else 0):
        before = found.x[:n]
        found = _solution(robot, data.loaded(before), variant, load=True)
        error = np.sqrt(np.diag(found.covariance)[:n])
        if (np.abs(found.x[:n] - before) <= SETTLED * error).all():
            break
    return Estimate(
        method=name,
        robot=robot,
        values=found.x[:n],
        scatter_covariance=found.covariance[:n, :n],
        drive_covariance=np.zeros((n, n)),
        degrees_of_freedom=np.full(n, max(found.n_blocks - 1.0, 1.0)),
        effect=np.zeros((n, 2 * robot.n_joints)),
        residual=found.residual,
        n_measurements=data.products.n_trajectories,
        condition={"all": found.condition},
        friction_law=FrictionLaw.absent(robot.n_joints),
        load_friction=_load_friction(found, variant, n) if variant.load else None,
    )


def _solution(robot: Robot, data: Products, variant: Variant, *, load: bool) -> Solution:
    """Solve with the columns of a variant; the column of load friction may still be missing."""
    data = data.only(places(variant.terms, offset=variant.offset, load=load))
    if variant.by_period:
        data = data.eliminate_friction(_n_local(variant))
    return solve(data, robot.torque_limit, variant.weighting, variant.solver)


def _n_local(variant: Variant) -> int:
    return N_OF_SPEED[variant.terms] if variant.by_period else 0


def _load_friction(found: Solution, variant: Variant, n_base: int) -> LoadFriction:
    """Return each axis's friction as a share of the transmitted torque."""
    columns = places(variant.terms, offset=variant.offset, load=True)[_n_local(variant) :]
    k = np.arange(n_base + columns.index(LOAD), len(found.x), len(columns))
    return LoadFriction(found.x[k], np.sqrt(np.diag(found.covariance)[k]))
