"""Weights of axes and solution are found from each other until they agree."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from free_run import TRUTH, arm, recorded

from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.regression.least_squares import solved
from hil.regression.terms import n_unknowns, place

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROBOT = arm()
LOUD = 1000.0
"""Noise of the first axis, 1e5 times that of the second [N m]."""


def reweighted(fit: SimultaneousFit, rounds: int) -> Array:
    """Base parameters after some rounds of weights from residuals, all axes alike at first."""
    items = [each.condensed() for _, axes in fit.stacked for each in axes]
    weight, n = np.ones(ROBOT.n_joints), n_unknowns(ROBOT)
    for _ in range(rounds):
        N, v = np.zeros((n, n)), np.zeros(n)
        for each in items:
            at = place(ROBOT, each.axis)
            N[np.ix_(at, at)] += weight[each.axis] * each.information
            v[at] += weight[each.axis] * each.vector
        x, left = solved(N, v), np.zeros((2, ROBOT.n_joints))
        for each in items:
            own = x[place(ROBOT, each.axis)]
            square = each.square - 2 * each.vector @ own + own @ each.information @ own
            left[:, each.axis] += square, each.n
        weight = left[1] / left[0]
    return x[: fit.n_base]


def test_weights_follow_residuals_until_neither_changes() -> None:
    rng = np.random.default_rng(0)
    prepared = []
    for motion, recording in recorded(ROBOT, TRUTH, n=1, duration=4.0, noise=0.01):
        loud = LOUD * rng.standard_normal(recording.tau.shape) * [1.0, 0.0]
        prepared.append((motion, signals(replace(recording, tau=recording.tau + loud))))
    fit = SimultaneousFit(ROBOT, prepared)
    assert not fit.loaded.any()
    once, always = reweighted(fit, 2), reweighted(fit, 20)
    assert np.abs(once - always).max() > 0.1
    np.testing.assert_allclose(fit.without_load_friction, always, rtol=1e-6)
