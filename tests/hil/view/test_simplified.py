"""Curve simplification in C, and in Python without a compiler."""

import numpy as np
import pytest

from hil.view import packed


@pytest.mark.parametrize("tolerance", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("n", [1, 2, 500])
def test_both_ways_keep_the_same_knots_within_the_tolerance(
    monkeypatch: pytest.MonkeyPatch, n: int, tolerance: float
) -> None:
    drawn = np.random.default_rng(2)
    time = np.cumsum(drawn.choice([0.0, 0.01], n, p=[0.1, 0.9]))  # repeated instants are permitted
    value = np.sin(time) + 0.02 * drawn.standard_normal(n)
    found = packed.simplify(time, value, tolerance)
    between = np.interp(time, found.time, found.value)
    once = np.diff(time, append=np.inf) * np.diff(time, prepend=-1.0) > 0
    assert np.abs(between - value)[once].max(initial=0.0) <= tolerance + 1e-12
    monkeypatch.setattr(packed, "_LIBRARY", None)
    again = packed.simplify(time, value, tolerance)
    np.testing.assert_array_equal(again.time, found.time)
    np.testing.assert_array_equal(again.value, found.value)
