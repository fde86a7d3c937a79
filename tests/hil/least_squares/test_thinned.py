"""Thinned windowing equals windowing of all samples at the kept samples."""

import numpy as np
import pytest

from hil.least_squares.window import smooth, smooth_at

PERIOD = 0.004


@pytest.mark.parametrize("passes", [1, 2])
def test_means_at_some_samples_are_those_that_smoothing_all_leaves_there(passes):
    x = np.random.default_rng(2).standard_normal((200, 3))
    index = np.array([20, 23, 26, 90, 93, 170])
    everywhere = x
    for _ in range(passes):
        everywhere = smooth(everywhere, PERIOD)
    assert smooth_at(index, x, PERIOD, passes) == pytest.approx(everywhere[index], abs=1e-12)


def test_no_samples_give_no_means():
    assert smooth_at(np.zeros(0, dtype=int), np.ones((50, 2)), PERIOD).shape == (0, 2)
