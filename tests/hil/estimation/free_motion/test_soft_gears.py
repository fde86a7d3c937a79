"""Elastic gears: compliances are identified from imported recordings, and cause no bias."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import PERIOD, TRUTH, arm, classical, recorded, some_motion, write_free_run

import hil
from hil.estimation.identify import estimate
from hil.estimation.options import Options
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.results.recorded_torque import predict_recording, torque_parts
from hil.results.tables.model import statements

if TYPE_CHECKING:
    from pathlib import Path

COMPLIANCE = np.array([5e-5, 2e-4])
"""Compliance of each gear [rad/(N m)]: the arm resonates at 5 and 8 Hz,
its motion has up to 1 Hz.
"""


def soft(seed: int) -> list:
    """Return recordings of motors whose arm is connected by elastic gears."""
    rng, found = np.random.default_rng(seed), []
    for k, (motion, each) in enumerate(recorded(arm(), TRUTH, seed=seed)):
        link = some_motion(each.time, seed + k)
        load = inverse_dynamics(arm(), TRUTH, *link)
        state = [link[0] + COMPLIANCE * load]
        for _ in range(2):
            state.append(np.gradient(state[-1], PERIOD, axis=0, edge_order=2))
        tau = load + motor_torque(arm(), *state) + classical(state[1])
        tau += 0.3 * rng.standard_normal(tau.shape)
        found.append((motion, replace(each, q=state[0], tau=tau)))
    return found


@pytest.mark.parametrize("seed", [0, 10])
def test_compliances_are_found_and_bias_no_parameter(seed: int) -> None:
    data = soft(seed)
    found = estimate(arm(), data, "free motion")
    stiff = estimate(arm(), data, "free motion", options=Options(nuisance=("lag", "drift")))
    assert list(found.details.compliance) == [1, 2]
    for each, c in zip(found.details.compliance.values(), COMPLIANCE, strict=True):
        assert abs(each.value - c) < 3 * each.standard_error
    assert np.abs((found.values - TRUTH) / found.standard_errors).max() < 3.0
    assert sum("compliance of axis" in text for text in statements(found.details)) == 2
    assert np.linalg.norm(found.values - TRUTH) < 0.1 * np.linalg.norm(stiff.values - TRUTH)


@pytest.mark.parametrize("seed", range(3))
def test_none_is_found_where_there_is_none(seed: int) -> None:
    found = estimate(arm(), recorded(arm(), TRUTH, seed=seed), "free motion")
    assert found.details.compliance == {}


def test_a_model_predicts_recordings_with_soft_gears(tmp_path: Path) -> None:
    data = soft(0)
    found = hil.regression(write_free_run(tmp_path / "run", arm(), data)).fit()
    model, (_, recording) = found.model, data[0]
    assert found.params["axis 1 compliance"] == pytest.approx(COMPLIANCE[0], rel=0.1)
    rigid = replace(model, details=model.details.model_copy(update={"compliance": {}}))
    with_gears, without = (predict_recording(each, recording) for each in (model, rigid))
    assert with_gears.overall == pytest.approx(model.details.overall_residual, rel=0.2)
    assert with_gears.overall < 0.9 * without.overall
    parts = torque_parts(model, recording)
    np.testing.assert_allclose(parts["left"], with_gears.residual, atol=1e-9)
