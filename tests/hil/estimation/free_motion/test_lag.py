"""Torque delay of each axis is estimated and compensated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from free_run import PERIOD, TRUTH, arm, recorded

from hil.estimation.identify import estimate
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
