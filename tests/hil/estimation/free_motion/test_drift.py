"""Friction whose level drifts during the measurement."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import COULOMB, OFFSET, PERIOD, TRUTH, VISCOUS, arm, recorded

from hil.estimation.free_motion.drift import levels
from hil.estimation.identify import estimate

if TYPE_CHECKING:
    from collections.abc import Callable

    from free_run import FreeRecorded

    from hil.estimation.estimate import Estimate

DURATION = 130.0


def falling(t: np.ndarray) -> np.ndarray:
    """Return the level of the first axis; the second one has 1."""
    return 1.3 - 0.6 * t / DURATION


def drifting(
    level: Callable[[np.ndarray], np.ndarray], duration: float = DURATION, n: int = 1
) -> FreeRecorded:
    """Return recordings whose friction, except the offset, has a given level over time."""
    found = []
    for k, (motion, each) in enumerate(
        recorded(arm(), TRUTH, lambda qd: 0 * qd, n=n, duration=duration)
    ):
        qd = np.gradient(each.q, PERIOD, axis=0)
        size = np.column_stack([level(each.time + k * duration), np.ones(len(qd))])
        tau = each.tau + OFFSET + size * (COULOMB * np.sign(qd) + VISCOUS * qd)
        found.append((motion, replace(each, tau=tau)))
    return found


@pytest.fixture(scope="module")
def warmed() -> Estimate:
    return estimate(arm(), drifting(falling), "free motion")


@pytest.fixture(scope="module")
def steady() -> Estimate:
    return estimate(arm(), drifting(np.ones_like), "free motion")


def test_a_level_that_falls_is_found_and_no_longer_left_in_the_torque(warmed: Estimate) -> None:
    first, second = warmed.details.axes
    assert first.level[0] == pytest.approx(1.3, abs=0.02)
    assert first.level[-1] == pytest.approx(0.7, abs=0.02)
    assert second.level == ()
    assert warmed.residual[0] == pytest.approx(warmed.residual[1], rel=0.3)


def test_the_law_is_that_of_the_mean_level(warmed: Estimate) -> None:
    plain = warmed.details.axes[0].plain
    assert plain["Coulomb"].value == pytest.approx(COULOMB[0], rel=0.02)
    assert np.abs(warmed.values - TRUTH).max() < 0.02


def test_how_far_the_level_went_counts_in_intervals_of_predicted_torques(warmed: Estimate) -> None:
    law = warmed.details.law
    assert [axis and axis.wander for axis in law.axes] == [pytest.approx(0.3, abs=0.02), 0.0]


def test_a_level_that_stays_is_not_found_to_change(steady: Estimate) -> None:
    assert [axis.level for axis in steady.details.axes] == [(), ()]


def test_a_drift_that_was_found_enlarges_no_standard_error(
    warmed: Estimate, steady: Estimate
) -> None:
    assert warmed.standard_errors == pytest.approx(steady.standard_errors, rel=0.3)


def test_a_drift_over_several_recordings_enlarges_no_standard_error(steady: Estimate) -> None:
    found = estimate(arm(), drifting(falling, DURATION / 2, 2), "free motion")
    assert found.details.axes[0].level[-1] == pytest.approx(0.7, abs=0.02)
    assert found.standard_errors == pytest.approx(steady.standard_errors, rel=0.5)


def test_short_recordings_and_methods_of_the_literature_know_one_level() -> None:
    short = estimate(arm(), drifting(falling, 50.0), "free motion").details
    usual = estimate(arm(), drifting(falling), "weighted least squares").details
    for found in (short, usual):
        assert found is not None
        assert found.axes[0].level == ()


def test_levels_are_linear_between_instants_and_zero_on_average() -> None:
    found = levels(120, 4)
    assert found.shape == (120, 4)
    assert found.mean(axis=0) == pytest.approx(0.0, abs=1e-12)
    bends = np.flatnonzero(np.abs(np.diff(found[:, 0], 2)) > 1e-12)
    assert set(bends.tolist()) <= {28, 29, 58, 59}
    assert levels(120, 0).shape == (120, 0)
