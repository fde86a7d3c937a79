"""Weights of axes and solution are iterated to convergence."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded

from hil.estimation.condensed import ROTOR
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.least_squares.solving import solved
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROBOT = arm()
LOUD = 1000.0
"""Noise of the first axis, 1e5 times that of the second [N m]."""


def reweighted(fit: SimultaneousFit, rounds: int) -> Array:
    """Return base parameters after some reweighting rounds, starting from equal weights."""
    blocks = fit.blocks.drop(ROTOR, "load", "load by direction").total
    products, counts, n_base = blocks.products[0], blocks.counts[0], len(base_parameters(ROBOT))
    k = products.shape[-1] - 1 - n_base
    places = [np.r_[:n_base, n_base + axis * k : n_base + (axis + 1) * k] for axis in range(2)]
    weight, n = np.ones(2), n_base + 2 * k
    for _ in range(rounds):
        N, v = np.zeros((n, n)), np.zeros(n)
        for at, product, each in zip(places, products, weight, strict=True):
            N[np.ix_(at, at)] += each * product[1:, 1:]
            v[at] += each * product[1:, 0]
        x = solved(N, v)
        around = [np.append(1.0, -x[at]) for at in places]
        left = [a @ product @ a for a, product in zip(around, products, strict=True)]
        weight = counts / left
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


def test_inertias_that_steps_of_encoders_make_too_small_are_within_what_is_stated() -> None:
    """The axes follow their commands here, so the whole bias by encoder steps must be removed."""
    step, prepared = 2e-4, []
    for motion, recording in recorded(ROBOT, TRUTH, n=4, duration=20.0, noise=1e-4):
        q = step * np.rint(recording.q / step)
        prepared.append((motion, signals(replace(recording, q=q))))
    fit = SimultaneousFit(ROBOT, prepared)
    change, covariance = fit.steps()
    missing, error = TRUTH - fit.solve(), np.sqrt(np.diag(covariance))
    worst = int(np.argmax(np.abs(missing) / np.abs(TRUTH)))
    assert missing[worst] == pytest.approx(2.0 * change[worst], rel=0.3)
    assert abs(missing[worst] - change[worst]) < 1.96 * error[worst]
    np.testing.assert_allclose(prepared[0][1].resolution, step, rtol=1e-6)
