"""Fit friction laws of the axes over a campaign, for known base parameters.

The methods for strokes and trajectories fit friction separately in every measurement, so that
friction drift does not bias the base parameters. The friction laws of the drives are fitted
afterwards: the torque of every usable sample, less motor and rigid-body torque, is

    Q_i - Qm_i - A_i(q, qd, qdd) p = F_i a_i + e,

with one law F_i a_i for all measurements of an axis, found by `hil.friction.search`.
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
    """Fit the friction law of every axis.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        Base parameters from the measurements of `stacks`.
    stacks : iterable of sequence of Stacked
        Moving axes of each measurement, or period of a trajectory.
    past : History, optional
        Motion history of the axes; without a history, warm-up is not modelled.
    """
    found: list[list[tuple[float, Array, Array, int]]] = [[] for _ in range(robot.n_joints)]
    for each in (each for axes in stacks for each in axes):
        v = np.abs(each.friction[:, OWN.index("viscous")])
        limits = np.array([v.min(), v.max()]) * robot.velocity_limit[each.axis]
        size = each.each * len(each.X)
        # products of friction residual and terms, shape (1 + n_terms, 1 + n_terms), times the
        # number of samples: a measurement counts by its duration
        common, rigid = each.loaded(each.load(p)).X[:, each.n_base :], each.X[:, : each.n_base]
        columns = dict(zip(OWN, each.friction.T, strict=True))
        columns |= dict(zip(("offset", "asymmetric"), common[:, ASYMMETRIC].T, strict=True))
        columns["load"] = common[:, LOAD]
        left = each.torques[:, 0] - rigid @ p
        whole = np.column_stack([left, *(columns[term] for term in OF_SPEED)])
        found[each.axis].append(
            (each.time, limits, np.asarray(each.each * (whole.T @ whole)), size)
        )
    limit = robot.velocity_limit.tolist()
    return FrictionLaw(
        axes=tuple(_law(own, limit[axis], past, axis) for axis, own in enumerate(found))
    )


def _law(
    measured: list[tuple[float, Array, Array, int]], limit: float, past: History | None, axis: int
) -> AxisLaw | None:
    """Fit the law of an axis from times, speed ranges, products and sizes of measurements."""
    if len(measured) < FOR_A_LAW:
        return None
    in_time = sorted(measured, key=lambda each: each[0])
    time, limits, products, sizes = map(np.array, zip(*in_time, strict=True))
    blocks = Blocks((), tuple(OF_SPEED), products[:, np.newaxis], sizes[:, np.newaxis])
    speeds = float(limits[:, 0].min()), float(limits[:, 1].max())
    return axis_law(blocks, limit, speeds, time, past, axis)
