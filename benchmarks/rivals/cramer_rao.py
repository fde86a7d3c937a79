"""Cramer-Rao bound: the best precision of any unbiased estimator of the base parameters.

The bound holds for the recorded measurements, with white torque noise of known variance and exactly
known motion: the inverse of Fisher's information (Kay, *Fundamentals of Statistical Signal
Processing*, 1993, chapter 3). Further unknowns are those of the simultaneous estimator: friction of
each measurement and the common terms of each axis. With `friction_known` the bound is lower. The
bound uses every unfiltered sample of an axis in motion. An estimator is less precise because of its
filter, of samples left out, and of friction errors that are not white.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.signals import signals
from hil.friction.equation import n_unknowns, place, term_columns
from hil.least_squares.solving import eliminated, inverse
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import ELEMENT_KINDS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

MOVING = 0.005
"""Share of the speed limit above which an axis is in motion."""


def cramer_rao(
    robot: Robot,
    recorded: Iterable[tuple[RecordedMotion, Recording]],
    variance: Array,
    *,
    friction_known: bool = False,
) -> Array:
    """Return the least covariance of the base parameters, shape (n_base, n_base).

    Parameters
    ----------
    robot : Robot
    recorded : iterable of (RecordedMotion, Recording)
        Measurements with recordings; only the motion is used.
    variance : ndarray, shape (n_joints,)
        Variance of the torque noise, per sample [(N m)^2].
    friction_known : bool
        True if friction and common terms are known.
    """
    n_base, n = len(base_parameters(robot)), n_unknowns(robot)
    information = np.zeros((n, n))
    for measurement, recording in recorded:
        if measurement.kind not in ELEMENT_KINDS:
            continue
        try:
            s = signals(recording)
        except NotEnoughData:
            continue
        for axis in measurement.moved:
            at = np.ix_(place(robot, axis), place(robot, axis))
            share = _share(robot, s, axis, friction_known=friction_known)
            information[at] += share / variance[axis]
    if friction_known:
        information = information[:n_base, :n_base]
    return inverse(information)[:n_base, :n_base]


def _share(robot: Robot, s: Signals, axis: int, *, friction_known: bool) -> Array:
    """Return X'X of one axis in one measurement, with friction eliminated."""
    moving = np.abs(s.smoothed(s.qd[:, axis])) > MOVING * robot.velocity_limit[axis]
    rows, common, friction = term_columns(robot, s, axis)
    X = np.column_stack([rows, common, friction])[moving & s.valid]
    product = X.T @ X
    if friction_known or not len(X):
        kept: Array = product[: -friction.shape[1], : -friction.shape[1]]
        return kept
    return eliminated(product, friction.shape[1])[0]
