"""What a plan can identify, before anything moves.

Each measurement gives one row of an observation matrix: gravity measurements the row of the
axis's gravity torque, eq. (14), inertia measurements that of M_ii and coupling measurements that
of M_ij, eq. (17), each over the base parameters of its own group and weighted with the axis's
torque limit, eq. (16). The rank of a group's matrix W states whether every parameter can be
distinguished from the others, its condition number how well the worst combination can, and, with
columns scaled to unit length, sqrt(diag((W'W)^-1)) how many times larger a parameter's standard
error is than if all the others were known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.planning.measurement import ELEMENT_KINDS, element_measurements
from hil.regression.least_squares import inverse, inverse_root, undetermined

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.measurement import ElementMeasurement
    from hil.planning.plan import Plan

INFLATION = 10.0
"""Growth of a standard error, by the others being unknown too, above which it is too much."""


@dataclass(frozen=True, slots=True)
class Identifiability:
    """One group of base parameters as a plan excites it.

    Attributes
    ----------
    group : str
        gravity, diagonal or off_diagonal.
    names : tuple of str
        Its parameters.
    rows : int
        Measurements that serve it.
    rank : int
        Of the observation matrix; all parameters can be identified when it is ``len(names)``.
    condition : float
        Ratio of its largest to its smallest singular value; inf where the rank is short.
    poorly_identifiable : tuple of str
        Parameters that cannot be distinguished from others, or only badly.
    """

    group: str
    names: tuple[str, ...]
    rows: int
    rank: int
    condition: float
    poorly_identifiable: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Every parameter of the group can be identified."""
        return self.rank == len(self.names)


def identifiability(plan: Plan, robot: Robot) -> tuple[Identifiability, ...]:
    """Judge each group of base parameters that the robot has."""
    base = base_parameters(robot)
    return tuple(
        _judge(group, tuple(base.names[c] for c in columns), group_observations(plan, robot, group))
        for group, columns in base.groups.items()
        if columns
    )


def group_observations(plan: Plan, robot: Robot, group: str) -> NDArray[np.float64]:
    """Weighted observation matrix (n_measurements, n_group) of one group, in plan order."""
    chosen = [
        m for m in element_measurements(plan.measurements) if ELEMENT_KINDS[m.kind].group == group
    ]
    columns = list(base_parameters(robot).groups[group])
    if not chosen:
        return np.zeros((0, len(columns)))
    rows = _torque_rows(robot, chosen)[:, columns]
    limits = np.asarray(robot.torque_limit)[[m.index for m in chosen]]
    return np.asarray(rows / limits[:, None], dtype=np.float64)


def _torque_rows(robot: Robot, chosen: Sequence[ElementMeasurement]) -> NDArray[np.float64]:
    """Regressor rows of the axes read: at rest for gravity, per unit of acceleration else."""
    q = np.array([m.q for m in chosen], dtype=float)
    still = np.zeros_like(q)
    sample = np.arange(len(chosen))
    axis = np.array([m.index for m in chosen])
    at_rest: NDArray[np.float64] = regressor(robot, q, still, still)[sample, axis]
    qdd = np.array([m.unit_acceleration for m in chosen])
    if not qdd.any():
        return at_rest
    moving: NDArray[np.float64] = regressor(robot, q, still, qdd)[sample, axis]
    return moving - at_rest


def _judge(group: str, names: tuple[str, ...], W: NDArray[np.float64]) -> Identifiability:
    n = len(names)
    if not len(W):
        return Identifiability(group, names, 0, 0, float("inf"), names)
    N = W.T @ W
    rank, lost, condition = inverse_root(N).shape[1], undetermined(N), float("inf")
    if rank == n:
        lost = np.sqrt(np.diag(N) * np.diag(inverse(N))) > INFLATION
        condition = float(np.linalg.cond(W))
    poorly = tuple(name for name, is_lost in zip(names, lost, strict=True) if is_lost)
    return Identifiability(group, names, len(W), rank, condition, poorly)
