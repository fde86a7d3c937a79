"""Friction of each axis over a whole campaign, once the base parameters are found.

The methods for strokes and trajectories fit friction anew in every measurement, so that its drift
does no harm to the base parameters. What a drive has to overcome is found afterwards: of every
usable sample the torque less those of motors and rigid bodies,

    Q_i - Qm_i - A_i(q, qd, qdd) p = F_i a_i + e,

with one law F_i a_i for all measurements of an axis, which `hil.friction.search` finds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.friction.equation import ASYMMETRIC, LOAD, OWN
from hil.friction.law import FrictionLaw
from hil.friction.search import axis_law
from hil.friction.terms import OF_SPEED
from hil.least_squares.blocks import Blocks
from hil.planning.measurement import FOR_A_LAW

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.arrays import Array
    from hil.estimation.condensed import Stacked
    from hil.friction.law import AxisLaw
    from hil.friction.warmth import History
    from hil.model.robot import Robot


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
    found: list[list[tuple[float, Array, Array, int]]] = [[] for _ in range(robot.n_joints)]
    for each in (each for axes in stacks for each in axes):
        v = np.abs(each.friction[:, OWN.index("viscous")])
        limits = np.array([v.min(), v.max()]) * robot.velocity_limit[each.axis]
        size = each.each * len(each.X)
        found[each.axis].append((each.time, limits, _product(each, p), size))
    limit = robot.velocity_limit.tolist()
    return FrictionLaw(
        axes=tuple(_law(own, limit[axis], past, axis) for axis, own in enumerate(found))
    )


def _product(each: Stacked, p: Array) -> Array:
    """Products of what is left for friction and its terms, shape (1 + n_terms, 1 + n_terms).

    A measurement counts by its duration, so they are multiplied by its number of samples.
    """
    common, rigid = each.loaded(each.load(p)).X[:, each.n_base :], each.X[:, : each.n_base]
    columns = dict(zip(OWN, each.friction.T, strict=True))
    columns |= dict(zip(("offset", "asymmetric"), common[:, ASYMMETRIC].T, strict=True))
    columns["load"] = common[:, LOAD]
    left = each.torques[:, 0] - rigid @ p
    whole = np.column_stack([left, *(columns[term] for term in OF_SPEED)])
    return np.asarray(each.each * (whole.T @ whole))


def _law(
    measured: list[tuple[float, Array, Array, int]], limit: float, past: History | None, axis: int
) -> AxisLaw | None:
    """Law of one axis from time, slowest and fastest speed, products and size of measurements."""
    if len(measured) < FOR_A_LAW:
        return None
    in_time = sorted(measured, key=lambda each: each[0])
    time, limits, products, sizes = map(np.array, zip(*in_time, strict=True))
    blocks = Blocks((), tuple(OF_SPEED), products[:, np.newaxis], sizes[:, np.newaxis])
    speeds = float(limits[:, 0].min()), float(limits[:, 1].max())
    return axis_law(blocks, limit, speeds, time, past, axis)
