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
from hil.friction.terms import DRIFT, OF_SPEED
from hil.least_squares.blocks import Blocks
from hil.least_squares.solving import eliminated
from hil.planning.measurement import FOR_A_LAW

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.arrays import Array
    from hil.estimation.condensed import Stacked
    from hil.friction.law import AxisLaw
    from hil.friction.warmth import History
    from hil.model.robot import Robot


_Measured = tuple[float, "Array", "Array", int, float]
"""Time, speed range, products, size and sum of squares of the noise of an axis's measurement."""


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
    found: list[list[_Measured]] = [[] for _ in range(robot.n_joints)]
    for each in (each for axes in stacks for each in axes):
        v = np.abs(each.friction[:, OWN.index("viscous")])
        limits = np.array([v.min(), v.max()]) * robot.velocity_limit[each.axis]
        # products of friction residual, terms and drift, times the number of samples: a measurement
        # counts by its duration
        common, rigid = each.loaded(each.load(p)).X[:, each.n_base :], each.X[:, : each.n_base]
        columns = dict(zip(OWN, each.friction.T, strict=True))
        columns |= dict(zip(("offset", "asymmetric"), common[:, ASYMMETRIC].T, strict=True))
        columns["load"], n = common[:, LOAD], len(each.X)
        left = each.torques[:, 0] - rigid @ p
        whole = np.column_stack([left, *(columns[term] for term in (*OF_SPEED, DRIFT))])
        product = np.asarray(each.each * (whole.T @ whole))
        noise, rank = eliminated(product, len(product) - 1)
        unbiased = float(noise[0, 0]) * n / max(n - rank, 1)
        found[each.axis].append((each.time, limits, product, each.each * n, unbiased))
    limit = robot.velocity_limit.tolist()
    return FrictionLaw(
        axes=tuple(_law(own, limit[axis], past, axis) for axis, own in enumerate(found))
    )


def _law(
    measured: list[_Measured], limit: float, past: History | None, axis: int
) -> AxisLaw | None:
    """Fit the law of an axis to its measurements."""
    if len(measured) < FOR_A_LAW:
        return None
    in_time = sorted(measured, key=lambda each: each[0])
    time, limits, products, sizes, noise = map(np.array, zip(*in_time, strict=True))
    known = products[:, np.newaxis, :-1, :-1]
    blocks = Blocks((), tuple(OF_SPEED), known, sizes[:, np.newaxis])
    speeds = float(limits[:, 0].min()), float(limits[:, 1].max())
    return axis_law(blocks, limit, speeds, time, past, axis, float(noise.sum()))
