"""Identifiability of base parameters by a plan, from observation matrices.

Each measurement gives one row of an observation matrix: gravity measurements the row of the axis's
gravity torque, eq. (14), inertia measurements that of M_ii and coupling measurements that of M_ij,
eq. (17), each over the base parameters of its own group and weighted with the axis's torque limit,
eq. (16). The rank of a group's matrix W shows if all parameters can be distinguished; the condition
number shows the excitation of the worst combination. With columns of unit length,
sqrt(diag((W'W)^-1)) is the factor by which the other unknown parameters increase a parameter's
standard error.

If gravity parameters are hidden from g(q), for example by torque offsets
(`hil.model.dependencies`), their group is judged by the rows of all kinds together: over all base
parameters and an offset of each axis's gravity torque, everything but the group eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.solving import IDENTIFIABLE, eliminated, inverse, inverse_root, undetermined
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.planning.measurement import ELEMENT_KINDS, element_measurements

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.model.robot import Robot
    from hil.planning.plan import Plan


@dataclass(frozen=True, slots=True)
class Identifiability:
    """Identifiability of a group of base parameters by a plan.

    Attributes
    ----------
    group : str
        gravity, diagonal or off_diagonal.
    names : tuple of str
        Parameters of the group.
    rows : int
        Number of measurements for the group.
    rank : int
        Rank of the observation matrix; full at ``len(names)``.
    condition : float
        Ratio of the observation matrix's largest to its smallest singular value; inf for a rank
        defect.
    poorly_identifiable : tuple of str
        Parameters that are hardly or not distinguishable from others.
    hidden : tuple of str
        Parameters that gravity measurements do not distinguish from torque offsets or from each
        other, but acceleration does.
    """

    group: str
    names: tuple[str, ...]
    rows: int
    rank: int
    condition: float
    poorly_identifiable: tuple[str, ...]
    hidden: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """True if every parameter of the group can be identified."""
        return self.rank == len(self.names)


def identifiability(plan: Plan, robot: Robot) -> tuple[Identifiability, ...]:
    """Judge every group of the robot's base parameters."""
    base, found = base_parameters(robot), []
    for group, columns in ((name, list(own)) for name, own in base.groups.items() if own):
        names = tuple(base.names[c] for c in columns)
        W = group_observations(plan, robot, group)
        hidden = tuple(base.names[c] for c in columns if base.dependencies.hidden[c])
        if not (hidden and len(W)):
            found.append(_judge(group, names, len(W), W.T @ W))
            continue
        rows, axes = [], []
        for kind in ELEMENT_KINDS.values():
            own = [m for m in element_measurements(plan.measurements) if m.kind == kind.name]
            rows.append(group_observations(plan, robot, kind.group, range(len(base))))
            axes += [m.index if kind.symbol == "g" else -1 for m in own]
        normal = eliminate_others(np.vstack(rows), np.array(axes), columns)
        found.append(replace(_judge(group, names, len(W), *normal), hidden=hidden))
    return tuple(found)


def group_observations(
    plan: Plan, robot: Robot, group: str, columns: Sequence[int] | None = None
) -> Array:
    """Return the weighted observation matrix of a group's kind of measurement, in plan order.

    Parameters
    ----------
    columns : sequence of int, optional
        Indices of base parameters; by default those of the group.

    Returns
    -------
    W : ndarray, shape (n_measurements, n_columns)
    """
    chosen = [
        m for m in element_measurements(plan.measurements) if ELEMENT_KINDS[m.kind].group == group
    ]
    shown = list(base_parameters(robot).groups[group] if columns is None else columns)
    if not chosen:
        return np.zeros((0, len(shown)))
    # the read axes at rest for gravity, else per unit acceleration
    q = np.array([m.q for m in chosen], dtype=float)
    still, axis = np.zeros_like(q), np.array([m.index for m in chosen])
    rows = regressor(robot, q, still, still)[np.arange(len(q)), axis]
    qdd = np.array([m.unit_acceleration for m in chosen])
    if qdd.any():
        rows = regressor(robot, q, still, qdd)[np.arange(len(q)), axis] - rows
    limits = np.asarray(robot.torque_limit)[axis]
    return np.asarray(rows[:, shown] / limits[:, None], dtype=np.float64)


def eliminate_others(
    rows: Array, of_gravity: Indices, columns: Sequence[int]
) -> tuple[Array, Array]:
    """Compute normal equations of some parameters, eliminating offsets and the rest.

    Parameters
    ----------
    rows : ndarray, shape (n, n_base)
        Weighted rows of elements of g(q) and M(q).
    of_gravity : ndarray, shape (n,)
        Axis of each row of g(q), whose offset is unknown; -1 for rows of M(q).
    columns : sequence of int
        Indices of the parameters of interest.

    Returns
    -------
    N : ndarray, shape (n_columns, n_columns)
    size : ndarray, shape (n_columns,)
        Diagonal of the normal equations before the elimination, as reference for N.
    """
    axes = np.unique(of_gravity[of_gravity >= 0])
    offsets = (of_gravity[:, np.newaxis] == axes).astype(float)
    others = np.setdiff1d(np.arange(rows.shape[1]), columns)
    W = np.hstack([rows[:, list(columns)], rows[:, others], offsets])
    N = W.T @ W
    return eliminated(N, W.shape[1] - len(columns))[0], np.diag(N)[: len(columns)]


def _judge(
    group: str, names: tuple[str, ...], n_rows: int, N: Array, size: Array | None = None
) -> Identifiability:
    n = len(names)
    if not n_rows:
        return Identifiability(group, names, 0, 0, float("inf"), names)
    rank, condition = inverse_root(N, IDENTIFIABLE, size).shape[1], float("inf")
    lost = undetermined(N, IDENTIFIABLE, size)
    if rank == n:
        # limit: a tenfold standard error due to the other unknowns
        lost = np.sqrt(np.diag(N) * np.diag(inverse(N))) > 10.0
        condition = float(np.sqrt(np.linalg.cond(N)))
    poorly = tuple(name for name, is_lost in zip(names, lost, strict=True) if is_lost)
    return Identifiability(group, names, n_rows, rank, condition, poorly)
