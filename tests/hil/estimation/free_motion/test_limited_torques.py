"""Torques at a limit in motion are left out."""

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded

from hil.estimation.identify import estimate
from hil.least_squares.standstill import limited


@pytest.mark.parametrize("step", [0.0, 2.0])
def test_torques_at_a_limit_are_left_out(step):
    data = recorded(arm(), TRUTH)
    for _, recording in data:
        tau = recording.tau[:, 0]
        tau[:] = np.clip(step * np.round(tau / step) if step else tau, -40.0, 60.0)
    found = estimate(arm(), data, "free motion")
    assert "axis 1: torque at a limit in up to" in "\n".join(found.details.remarks)
    assert np.all(np.abs(found.values - TRUTH) < 1.5 * found.half_width())


def test_a_greatest_torque_at_rest_or_in_steps_is_no_limit():
    t = np.linspace(0.0, 20.0, 4000)
    q = np.where(t < 10.0, 0.0, np.cos(t - 10.0) - 1.0)[:, np.newaxis]
    for tau in (10.0 + q, np.round(7.0 * q)):
        assert not limited(q, tau, 0.005).any()
    assert limited(q, np.minimum(q, -0.5), 0.005).any()
