"""Few samples of a drawn recording are predicted, including its extremes."""

from __future__ import annotations

import numpy as np
import pytest

from hil.results.recorded_torque import PredictedTorque, thin_rows


@pytest.mark.parametrize("n", [1, 7, 55, 56, 57, 4001])
def test_the_extremes_of_each_stretch_are_drawn(n: int) -> None:
    torque = np.random.default_rng(n).normal(size=(n, 2))
    kept = thin_rows(torque, 7)
    assert (np.diff(kept) > 0).all()
    for begin in range(0, n, 56):
        of = torque[begin : begin + 56]
        drawn = torque[kept[(begin <= kept) & (kept < begin + 56)]]
        assert np.array_equal(drawn.min(axis=0), of.min(axis=0))
        assert np.array_equal(drawn.max(axis=0), of.max(axis=0))


def test_a_spike_of_one_sample_is_drawn_and_few_others() -> None:
    torque = np.zeros(5000)
    torque[[1237, 3001]] = 40.0, -25.0
    kept = thin_rows(torque, 10)
    assert {1237, 3001} <= set(kept.tolist())
    assert len(kept) <= 500 + 2


def test_no_more_samples_than_there_are_and_none_of_none() -> None:
    assert thin_rows(np.zeros((4, 1)), 0).tolist() == [0, 1, 2, 3]
    assert thin_rows(np.empty((0, 6)), 7).tolist() == []


def test_a_part_shows_peaks_of_the_torque_and_of_what_the_model_leaves() -> None:
    n = 4000
    measured, predicted = np.zeros(n), np.full(n, np.nan)
    predicted[500:3500] = 0.0
    measured[1001], predicted[2003] = 30.0, 12.0
    of = np.zeros(n)
    whole = PredictedTorque("m", (0,), np.arange(n) * 0.01, of, measured, predicted, of, of, of)
    shown = whole.part(0.0, 40.0, 400)
    assert len(shown.time) < 600
    assert shown.measured.max() == 30.0
    assert np.nanmin(shown.residual) == -12.0
