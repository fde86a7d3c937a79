"""Torque delay of each axis is estimated and compensated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from free_run import PERIOD, TRUTH, arm, classical, recorded, short_moves

from hil.estimation.identify import estimate
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.results.tables.model import statements

LAGS = np.array([0.004, 0.008])


def lagging(seed: int, lags: np.ndarray = LAGS) -> list:
    """Return recordings with torque delays of whole samples."""
    late = []
    for motion, each in recorded(arm(), TRUTH, seed=seed):
        columns = [np.roll(x, round(lag / PERIOD)) for x, lag in zip(each.tau.T, lags, strict=True)]
        late.append((motion, replace(each, tau=np.column_stack(columns))))
    return late


@pytest.mark.parametrize("lags", [LAGS, np.array([0.0, 0.024])], ids=["both", "one"])
@pytest.mark.parametrize("seed", [0, 10])
def test_lags_are_found_and_bias_no_parameter(seed: int, lags: np.ndarray) -> None:
    data = lagging(seed, lags)
    found, plain = (estimate(arm(), data, name) for name in ("free motion", "least squares"))
    assert found.details.lag
    for each, lag in zip(found.details.lag, lags, strict=True):
        assert each.value == pytest.approx(lag, abs=3e-4)
        assert abs(each.value - lag) <= 3 * each.standard_error
    late = sum("ms after the position" in text for text in statements(found.details))
    assert late == np.count_nonzero(lags)
    z = np.abs(found.values - TRUTH) / found.standard_errors
    assert z.max() < 3.0
    assert np.linalg.norm(found.values - TRUTH) < 0.5 * np.linalg.norm(plain.values - TRUTH)


@pytest.mark.parametrize("seed", range(3))
def test_none_is_found_where_there_is_none(seed: int) -> None:
    found = estimate(arm(), recorded(arm(), TRUTH, seed=seed), "free motion")
    assert [each.value for each in found.details.lag] == [0.0, 0.0]


@pytest.mark.parametrize("seed", [4, 9, 20, 28, 30])
def test_few_fast_samples_show_no_lag_at_the_edge_of_the_search(seed: int) -> None:
    """Moves shorter than the low-pass leave fewer fast samples than unknowns."""
    robot, rng = arm(), np.random.default_rng(seed)
    (motion, recording), *_ = recorded(robot, TRUTH, n=1, duration=60.0)
    made = short_moves(recording.time, rng)
    tau = inverse_dynamics(robot, TRUTH, *made) + classical(made[1]) + motor_torque(robot, *made)
    tau += 0.3 * rng.standard_normal(tau.shape)
    data = [(motion.model_copy(update={"cut_off": 6.0}), replace(recording, q=made[0], tau=tau))]
    found = estimate(robot, data, "free motion")
    assert found.edges == ()
    assert [each.value for each in found.details.lag] == [0.0, 0.0]
    assert "in one direction" not in "\n".join(found.details.remarks)
