"""Mass matrices of impossible bodies are corrected within
the uncertainty, and otherwise reported.
"""

from __future__ import annotations

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded

from hil.estimation.free_motion.positive import least_inertia, nearest_positive
from hil.estimation.identify import estimate

IMPOSSIBLE = np.array([6.0, 8.0, 0.4, -3.0, 2.0, -0.3])


def configurations() -> np.ndarray:
    return np.random.default_rng(0).uniform(-2, 2, (50, 2))


def test_what_is_positive_stays_as_it_is() -> None:
    assert (nearest_positive(arm(), TRUTH, np.eye(6), configurations()) == TRUTH).all()


def test_what_is_not_becomes_so_and_moves_by_no_more_than_that_takes() -> None:
    robot, q, V = arm(), configurations(), np.diag([1.0, 0.1, 0.1, 1.0, 0.1, 0.1])
    x = nearest_positive(robot, IMPOSSIBLE, V, q)
    assert least_inertia(robot, IMPOSSIBLE, q) < 0 < least_inertia(robot, x, q)
    halfway = (x + IMPOSSIBLE) / 2
    assert least_inertia(robot, halfway, q) < least_inertia(robot, x, q)


def test_an_estimate_that_the_data_insist_on_is_left_and_the_contradiction_stated() -> None:
    found = estimate(arm(), recorded(arm(), IMPOSSIBLE), "free motion")
    assert found.values == pytest.approx(IMPOSSIBLE, abs=0.02)
    assert found.details.least_inertia < 0
    assert any("positive definite" in remark for remark in found.details.remarks)
